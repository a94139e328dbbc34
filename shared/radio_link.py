"""The datagrams of the hand's radio (`net.profile = "radio"`): one per message, with no handshake and no state.

| bytes | content |
|---|---|
| 0-1 | `SR` |
| 2 | version 1 |
| 3 | length of the swarm's name |
| 4 | length of the key |
| 5- | the name and the key in UTF-8, then the payload |

Whoever begins to listen understands the next datagram; whoever misses some has missed just these.
"""

import ipaddress
import re
import struct
from typing import NamedTuple

from shared.errors import ConfigError, DecodeError
from shared.scenario import Net
from shared.validators import MAX_PORT

GROUP = "224.0.0.225"
"""Link-local: no router forwards it, and switches flood it, whoever they believe to listen."""
PORT = 7450

MAX_DATAGRAM = 8192
"""More than a message ever needs; what is over the codec's 4 KiB but under this is the codec's to count."""

_MAGIC = b"SR"
_VERSION = 1
_HEAD = struct.Struct("<2sBBB")
_ADDRESS = re.compile(r"([0-9.]+):([0-9]{1,5})")


class RadioGroup(NamedTuple):
    """Where a radio speaks: a multicast group, its UDP port, and the network interface that leads there."""

    address: str
    port: int
    interface: str

    def __str__(self) -> str:
        return f"{self.address}:{self.port} on {self.interface}"


class Said(NamedTuple):
    """A decoded datagram: which swarm it is for, the key without the swarm's name, and the payload."""

    swarm: str
    key: str
    payload: bytes


def radio_group(net: Net) -> RadioGroup:
    """Reads where the radio of a scenario speaks.

    Raises:
        ConfigError: `net.multicast` is no multicast group with a port.
    """
    if not net.multicast:
        return RadioGroup(GROUP, PORT, net.interface)
    found = _ADDRESS.fullmatch(net.multicast)
    try:
        if found and ipaddress.IPv4Address(found[1]).is_multicast and 0 < int(found[2]) <= MAX_PORT:
            return RadioGroup(found[1], int(found[2]), net.interface)
    except ValueError:  # four numbers, but no address
        pass
    raise ConfigError(f"net.multicast: {net.multicast!r} is no group and port; for example {GROUP}:{PORT}")


def encode_head(swarm: str, key: str) -> bytes:
    """Encodes what stands before the payload of every datagram on one key.

    Raises:
        ConfigError: The name does not fit.
    """
    name, path = swarm.encode(), key.encode()
    try:
        return _HEAD.pack(_MAGIC, _VERSION, len(name), len(path)) + name + path
    except struct.error as error:
        raise ConfigError(f"swarm.name: {len(name)} bytes, on a radio at most 255") from error


def decode_datagram(datagram: bytes) -> Said:
    """Decodes and checks one datagram; the payload is the codec's to judge.

    Raises:
        DecodeError: Whatever is wrong with it (`oversized`, `malformed`, `version`); nothing else is raised.
    """
    if len(datagram) > MAX_DATAGRAM:
        raise DecodeError("oversized", f"more than {MAX_DATAGRAM} bytes")
    if len(datagram) < _HEAD.size:
        raise DecodeError("malformed", f"{len(datagram)} bytes")
    magic, version, name, path = _HEAD.unpack_from(datagram)
    if magic != _MAGIC:
        raise DecodeError("malformed", f"starts with {magic!r}")
    if version != _VERSION:
        raise DecodeError("version", f"version {version}, this process speaks {_VERSION}")
    key, payload = _HEAD.size + name, _HEAD.size + name + path
    if payload > len(datagram):
        raise DecodeError("malformed", "ends within its head")
    try:
        return Said(datagram[_HEAD.size : key].decode(), datagram[key:payload].decode(), datagram[payload:])
    except UnicodeDecodeError as error:
        raise DecodeError("malformed", "its head is no UTF-8") from error
