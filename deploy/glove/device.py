"""Finds the glove on a serial line, and waits until it answers."""

import time
from collections.abc import Iterator
from contextlib import closing, contextmanager

from serial.tools.list_ports import comports
from serial.tools.list_ports_common import ListPortInfo

from glove_bridge.gloves import open_glove
from glove_bridge.gloves.base import Glove
from glove_bridge.gloves.serial import SerialGlove
from shared.errors import ConfigError, DeviceError

ANSWER_S = 5.0
"""A board that opening the port has reset is there within 2 s."""


def usb_ports() -> list[ListPortInfo]:
    """Returns the serial ports behind USB, sorted by name."""
    return sorted((port for port in comports() if port.vid is not None), key=lambda port: str(port.device))


def only_port() -> str:
    """Returns the device of the only USB serial port.

    Raises:
        ConfigError: There is none, or there are several.
    """
    names = [str(port.device) for port in usb_ports()]
    if len(names) != 1:
        found = f"several USB serial ports: {', '.join(names)}" if names else "no USB serial port"
        raise ConfigError(f"{found}; name the glove: --glove serial:///dev/ttyACM0")
    return names[0]


@contextmanager
def worn(uri: str | None) -> Iterator[Glove]:
    """Opens a glove, by default that on the only port, and closes it again.

    Raises:
        ConfigError: Its URI is refused, or there is no telling which one.
        DeviceError: It does not answer.
    """
    with closing(open_glove(uri or f"serial://{only_port()}")) as glove:
        _await(glove, uri)
        yield glove


@contextmanager
def worn_on_serial(uri: str | None) -> Iterator[SerialGlove]:
    """Does the same where only a glove on a serial line will do.

    Raises:
        ConfigError: It is another glove; or as for `worn`.
        DeviceError: It does not answer.
    """
    with worn(uri) as glove:
        if not isinstance(glove, SerialGlove):
            raise ConfigError(f"{uri}: not a glove on a serial line; for example serial:///dev/ttyACM0")
        yield glove


def _await(glove: Glove, uri: str | None) -> None:
    deadline = time.monotonic() + ANSWER_S
    while not glove.connected:
        if time.monotonic() > deadline:
            raise DeviceError(
                f"{uri or 'glove'}: cannot be used: {glove.fault}; see docs/glove.md, first evening"
            )
        time.sleep(0.01)
