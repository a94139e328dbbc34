"""`swarmtouch glove ports`: the serial ports of this machine."""

import argparse

from serial.tools.list_ports import comports


def run(_: argparse.Namespace) -> int:
    """Lists them, USB first; returns 1 if there is none."""
    ports = sorted(comports(), key=lambda port: (port.vid is None, str(port.device)))
    for port in ports:
        usb = "" if port.vid is None else f"  USB {port.vid:04x}:{port.pid:04x}"
        print(f"serial://{port.device}  {port.description}{usb}")
    if not ports:
        print("no serial ports; is the board plugged in, and are you in the group that may use it (dialout)?")
    return 0 if ports else 1
