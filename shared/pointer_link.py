"""The datagrams between a console and the relay's `pointer://` source, on a socket of their user alone.

| bytes | content |
|---|---|
| 0-1 | `SP` |
| 2 | version 1 |
| 3 | verb |
| 4-11 | sender, uint64: one number per console process |
| 12- | position x, y, z (m, world frame), yaw (rad), float64 |

All little-endian. While somebody holds the hand, a datagram comes for each of its movements and at least every
`REPEAT_S`; while pages are open and nobody holds it, `RELEASED` comes as often. STOP is final, whoever says it.
"""

import enum
import struct
from typing import NamedTuple

from shared.errors import DecodeError
from shared.messages import MAX_POSITION, ORIGIN, Vector, Wish

DEFAULT_SOCKET = "pointer.sock"
"""Name of the socket unless another is chosen (`shared.private_socket`)."""

REPEAT_S = 0.05
SILENT_S = 0.3
"""A console that is silent for so long no longer holds the hand."""

MAX_DATAGRAM = 64
"""More than any valid datagram: longer ones arrive cut and are refused by their length."""

_MAGIC = b"SP"
_VERSION = 1
_MAX_YAW = 1_000.0
_LAYOUT = struct.Struct("<2sBBQ4d")


class Verb(enum.IntEnum):
    """What the console says: that nobody holds the hand, or the wish of whoever does."""

    RELEASED = 0
    GROUND = 1
    FLY = 2
    HOLD = 3
    STOP = 4


WISHES = {Verb.GROUND: Wish.GROUND, Verb.FLY: Wish.FLY, Verb.HOLD: Wish.HOLD, Verb.STOP: Wish.STOP}


class Pointed(NamedTuple):
    """A decoded datagram; position and yaw count while the hand is held."""

    sender: int
    verb: Verb
    position: Vector = ORIGIN
    yaw: float = 0.0


def encode_pointed(pointed: Pointed) -> bytes:
    """Encodes one datagram."""
    return _LAYOUT.pack(_MAGIC, _VERSION, pointed.verb, pointed.sender, *pointed.position, pointed.yaw)


def decode_pointed(datagram: bytes) -> Pointed:
    """Decodes and checks one datagram.

    Raises:
        DecodeError: For whatever is wrong with it; nothing else is raised.
    """
    if len(datagram) != _LAYOUT.size:
        raise DecodeError("malformed", f"{len(datagram)} bytes instead of {_LAYOUT.size}")
    magic, version, verb, sender, x, y, z, yaw = _LAYOUT.unpack(datagram)
    if magic != _MAGIC:
        raise DecodeError("malformed", f"starts with {magic!r}")
    if version != _VERSION:
        raise DecodeError("version", f"version {version}, this process speaks {_VERSION}")
    if verb not in iter(Verb):
        raise DecodeError("out-of-range", f"verb {verb}")
    # A NaN fails every comparison, so it is refused here as well.
    if not (all(abs(number) <= MAX_POSITION for number in (x, y, z)) and abs(yaw) <= _MAX_YAW):
        raise DecodeError("out-of-range", f"position ({x}, {y}, {z}), yaw {yaw}")
    return Pointed(sender, Verb(verb), (x, y, z), yaw)
