"""The datagrams between a simulated vehicle's driver and the world; they stand for a radio link.

Every datagram names its drone, and every one towards the world says where that drone's poses go.

| bytes | command (32) | pose (80) |
|---|---|---|
| 0-1 | `ST` | `ST` |
| 2 | version 1 | version 1 |
| 3 | verb | 16 on the ground, 17 airborne |
| 4-7 | drone, uint32 | drone, uint32 |
| 8- | set-point x, y, z, float64 | seq, uint64; position, velocity, yaw, battery, float64 |

All little-endian, SI units, world frame.
"""

import enum
import math
import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

from agents.vehicles.base import Pose
from shared.errors import DecodeError
from shared.messages import MAX_POSITION, MAX_VELOCITY, ORIGIN, Vector

MAX_DATAGRAM = 128
"""More than any valid datagram: longer ones arrive cut and are refused by their length."""

_MAGIC = b"ST"
_VERSION = 1
_GROUNDED, _AIRBORNE = 16, 17
_COMMAND = struct.Struct("<2sBBI3d")
_POSE = struct.Struct("<2sBBIQ8d")


class Verb(enum.IntEnum):
    """What a driver asks of the world."""

    HELLO = 0
    FLY = 1
    DESCEND = 2
    IDLE = 3
    STOP = 4


class Order(NamedTuple):
    """A decoded command; the set-point counts for FLY only."""

    drone: int
    verb: Verb
    setpoint: Vector


def encode_order(drone: int, verb: Verb, setpoint: Vector = ORIGIN) -> bytes:
    """Encodes one command datagram."""
    return _COMMAND.pack(_MAGIC, _VERSION, verb, drone, *setpoint)


def decode_order(datagram: bytes) -> Order:
    """Decodes and checks one command datagram.

    Raises:
        DecodeError: For whatever is wrong with it; nothing else is raised.
    """
    verb, drone, *setpoint = _unpack(_COMMAND, datagram)
    try:
        known = Verb(verb)
    except ValueError as error:
        raise DecodeError("out-of-range", str(error)) from error
    return Order(drone, known, _vector(setpoint, MAX_POSITION))


def encode_pose(drone: int, pose: Pose) -> bytes:
    """Encodes one pose datagram."""
    kind = _AIRBORNE if pose.airborne else _GROUNDED
    return _POSE.pack(
        _MAGIC, _VERSION, kind, drone, pose.seq, *pose.position, *pose.velocity, pose.yaw, pose.battery
    )


def decode_pose(datagram: bytes) -> tuple[int, Pose]:
    """Decodes and checks one pose datagram.

    Returns:
        The drone and its pose.

    Raises:
        DecodeError: For whatever is wrong with it; nothing else is raised.
    """
    kind, drone, seq, *numbers, battery = _unpack(_POSE, datagram)
    if kind not in (_GROUNDED, _AIRBORNE):
        raise DecodeError("out-of-range", f"kind {kind}")
    *_, yaw = numbers
    if not (math.isfinite(yaw) and 0.0 <= battery <= 1.0):
        raise DecodeError("out-of-range", f"yaw {yaw}, battery {battery}")
    position, velocity = _vector(numbers[:3], MAX_POSITION), _vector(numbers[3:6], MAX_VELOCITY)
    return drone, Pose(position, velocity, yaw, battery, kind == _AIRBORNE, seq)


def _unpack(layout: struct.Struct, datagram: bytes) -> tuple[Any, ...]:
    """Returns the fields after magic and version."""
    if len(datagram) != layout.size:
        raise DecodeError("malformed", f"{len(datagram)} bytes instead of {layout.size}")
    magic, version, *fields = layout.unpack(datagram)
    if magic != _MAGIC:
        raise DecodeError("malformed", f"starts with {magic!r}")
    if version != _VERSION:
        raise DecodeError("version", f"version {version}, this process speaks {_VERSION}")
    return tuple(fields)


def _vector(numbers: Sequence[float], limit: float) -> Vector:
    x, y, z = numbers
    # A NaN fails every comparison, so it is refused here as well.
    if not (abs(x) <= limit and abs(y) <= limit and abs(z) <= limit):
        raise DecodeError("out-of-range", f"({x}, {y}, {z}), limit {limit}")
    return (x, y, z)
