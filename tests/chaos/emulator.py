"""A network in which every link has weather: one TUN device per namespace, all packets pass through here.

`python -m tests.chaos.emulator DEVICE NAMESPACE=ADDRESS...` says `ready` when all devices exist; each line of
JSON on its standard input is the weather from then on. It works for TCP, QUIC and UDP alike, and needs of the
kernel no more than `/dev/net/tun`.
"""

import ctypes
import fcntl
import ipaddress
import json
import os
import selectors
import struct
import sys
import time
from contextlib import suppress

from tests.chaos.weather import Line, Weather

TUNSETIFF = 0x400454CA
IFF_TUN_NO_PI = 0x0001 | 0x1000
CLONE_NEWNET = 0x40000000
MTU = 1500
LONGEST_WAIT = 0.5


def destination(packet: bytes) -> str | None:
    """Returns where an IPv4 packet goes, None if it is none."""
    if len(packet) < 20 or packet[0] >> 4 != 4:
        return None
    return str(ipaddress.IPv4Address(packet[16:20]))


def open_device(name: str, namespace: str) -> int:
    """Makes a TUN device in a namespace; it lives as long as the file that is returned."""
    libc = ctypes.CDLL(None, use_errno=True)
    home = os.open("/proc/self/ns/net", os.O_RDONLY)
    away = os.open(f"/run/netns/{namespace}", os.O_RDONLY)
    try:
        # The device belongs to the namespace in which its file was opened.
        _enter(libc, away)
        tun = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
        fcntl.ioctl(tun, TUNSETIFF, struct.pack("16sH22x", name.encode(), IFF_TUN_NO_PI))
    finally:
        _enter(libc, home)
        os.close(home)
        os.close(away)
    return tun


def _enter(libc: ctypes.CDLL, namespace: int) -> None:
    if libc.setns(namespace, CLONE_NEWNET):
        raise OSError(ctypes.get_errno(), "cannot enter the network namespace")


class Network:
    """All devices and the packets between them.

    Args:
        devices: File of the device at each address.
    """

    def __init__(self, devices: dict[str, int]) -> None:
        self.line = Line()
        self._devices = devices

    def read(self, device: int, now: float) -> None:
        """Puts what a device has sent on its way."""
        with suppress(BlockingIOError):
            while True:
                self.line.send(os.read(device, MTU), now)

    def deliver(self, now: float) -> None:
        """Hands over what has arrived; what goes nowhere, or to a device that is down, is dropped."""
        for packet in self.line.arrivals(now):
            device = self._devices.get(destination(packet) or "")
            if device is not None:
                with suppress(OSError):
                    os.write(device, packet)


def main() -> None:
    """Runs until standard input ends."""
    name, *places = sys.argv[1:]
    pairs = [place.split("=") for place in places]
    devices = {address: open_device(name, namespace) for namespace, address in pairs}
    network = Network(devices)
    with selectors.DefaultSelector() as selector:
        for device in devices.values():
            selector.register(device, selectors.EVENT_READ)
        selector.register(sys.stdin, selectors.EVENT_READ)
        print("ready", flush=True)
        while True:
            due = network.line.next_due
            wait = LONGEST_WAIT if due is None else max(0.0, due - time.monotonic())
            for key, _ in selector.select(wait):
                if key.fd == sys.stdin.fileno():
                    order = sys.stdin.readline()
                    if not order:
                        return
                    network.line.weather = Weather(**json.loads(order))
                else:
                    network.read(key.fd, time.monotonic())
            network.deliver(time.monotonic())


if __name__ == "__main__":
    main()
