"""From hand samples to the mapped hand: the point, velocity and yaw that the formation refers to.

The chase after the hand is limited by the *hand source's* own time between samples, never by this process's
clock: agents that use the same samples map them to the same point, whenever they happen to step.
"""

import math
from dataclasses import dataclass
from typing import Final, final

from agents.control.vectors import ORIGIN, Vector, clamp, norm, shorten

MAX_SAMPLE_GAP: Final = 0.1
"""A longer gap between two samples grants no further way to the chase, s."""

OUTERMOST_SPEED: Final = 1.0
"""Yaw turns the formation so that its outermost drone stays below this, m/s."""


@final
class HandInput:
    """One hand sample in the world frame.

    Attributes:
        position: m.
        velocity: m/s.
        yaw: rad.
        stamp: Time of the sample on its source's clock, s; only differences are used.
    """

    def __init__(self, position: Vector, velocity: Vector, yaw: float, stamp: float) -> None:
        self.position: Final = position
        self.velocity: Final = velocity
        self.yaw: Final = yaw
        self.stamp: Final = stamp


@final
class MappedHand:
    """The mapped hand.

    Attributes:
        point: Where the formation's human is, world frame, m.
        velocity: Its velocity, m/s.
        yaw: Heading of the formation, rad.
        yaw_rate: rad/s.
        stamp: Stamp of the sample it was made from, s.
    """

    def __init__(self, point: Vector, velocity: Vector, yaw: float, yaw_rate: float, stamp: float) -> None:
        self.point: Final = point
        self.velocity: Final = velocity
        self.yaw: Final = yaw
        self.yaw_rate: Final = yaw_rate
        self.stamp: Final = stamp


@final
@dataclass(frozen=True, kw_only=True)
class HandSettings:
    """How the hand is mapped.

    Attributes:
        gain: Factor on position and velocity.
        offset: Added to the position, m.
        height: Fixed height of the mapped hand, m; None: it follows the hand.
        follow_yaw: Whether the formation turns with the hand.
        max_speed: The mapped hand follows no faster than this, m/s.
        low: Lower corner that the mapped hand is clamped to, m.
        high: Upper corner, m.
        radius: Distance of the outermost drone at rest, m.
    """

    gain: float
    offset: Vector
    height: float | None
    follow_yaw: bool
    max_speed: float
    low: Vector
    high: Vector
    radius: float


def map_hand(previous: MappedHand | None, sample: HandInput, settings: HandSettings) -> MappedHand:
    """Maps one new hand sample.

    Args:
        previous: The mapped hand so far; None adopts the sample at once (a process has just started).
        sample: The hand.
        settings: Mapping and clamps.

    Returns:
        The mapped hand: at the target if it can be reached within `max_speed`, else on its way.
    """
    target, velocity = _target(sample, settings)
    yaw = sample.yaw if settings.follow_yaw else 0.0
    if previous is None:
        return MappedHand(target, shorten(velocity, settings.max_speed), yaw, 0.0, sample.stamp)
    gap = sample.stamp - previous.stamp
    dt = 0.0 if gap < 0.0 else MAX_SAMPLE_GAP if gap > MAX_SAMPLE_GAP else gap
    point, velocity = _chase(previous.point, target, velocity, settings.max_speed, dt)
    yaw_rate = 0.0
    if yaw != previous.yaw:
        yaw, yaw_rate = _turn(previous.yaw, yaw, OUTERMOST_SPEED / max(settings.radius, 0.1), dt)
    return MappedHand(point, velocity, yaw, yaw_rate, sample.stamp)


def freeze(mapped: MappedHand) -> MappedHand:
    """Returns the mapped hand at rest where it is (HOLD, or the hand is silent)."""
    return MappedHand(mapped.point, ORIGIN, mapped.yaw, 0.0, mapped.stamp)


def _target(sample: HandInput, settings: HandSettings) -> tuple[Vector, Vector]:
    """Applies mapping, fixed height and clamps; a clamped axis has no velocity."""
    x, y, z = sample.position
    u, v, w = sample.velocity
    a, b, c = settings.offset
    k = settings.gain
    x, y, z, u, v, w = a + k * x, b + k * y, c + k * z, k * u, k * v, k * w
    if settings.height is not None:
        z, w = settings.height, 0.0
    clamped = clamp((x, y, z), settings.low, settings.high)
    a, b, c = clamped
    return clamped, (u if a == x else 0.0, v if b == y else 0.0, w if c == z else 0.0)


def _chase(
    point: Vector, target: Vector, velocity: Vector, max_speed: float, dt: float
) -> tuple[Vector, Vector]:
    """Moves towards the target by at most `max_speed * dt`; arriving, it takes over the hand's velocity."""
    x, y, z = point
    a, b, c = target
    du, dv, dw = a - x, b - y, c - z
    distance = norm((du, dv, dw))
    if distance > max_speed * dt:
        u, v, w = du / distance * max_speed, dv / distance * max_speed, dw / distance * max_speed
        return (x + u * dt, y + v * dt, z + w * dt), (u, v, w)
    return target, shorten(velocity, max_speed)


def _turn(yaw: float, target: float, max_rate: float, dt: float) -> tuple[float, float]:
    way = math.remainder(target - yaw, 2.0 * math.pi)
    if abs(way) <= max_rate * dt:
        return target, way / dt if dt > 0.0 else 0.0
    rate = math.copysign(max_rate, way)
    return yaw + rate * dt, rate
