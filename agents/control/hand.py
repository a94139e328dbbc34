"""From hand samples to the mapped hand: the point, velocity and yaw that the formation refers to.

The chase after the hand is limited by the *hand source's* own time between samples, never by this process's
clock: agents that use the same samples map them to the same point, whenever they happen to step.
"""

import math

import numpy as np
from attrs import evolve, field, frozen

from shared.formation import Vec
from shared.scenario import Hand

MAX_SAMPLE_GAP = 0.1
"""A longer gap between two samples grants no further way to the chase, s."""

OUTERMOST_SPEED = 1.0
"""Yaw turns the formation so that its outermost drone stays below this, m/s."""


@frozen(kw_only=True)
class HandInput:
    """One hand sample in the world frame.

    Attributes:
        position: (3,) m.
        velocity: (3,) m/s.
        yaw: rad.
        stamp: Time of the sample on its source's clock, s; only differences are used.
    """

    position: Vec = field(eq=False)
    velocity: Vec = field(eq=False)
    yaw: float
    stamp: float


@frozen(kw_only=True)
class MappedHand:
    """The mapped hand.

    Attributes:
        point: (3,) where the formation's human is, world frame, m.
        velocity: (3,) its velocity, m/s.
        yaw: Heading of the formation, rad.
        yaw_rate: rad/s.
        stamp: Stamp of the sample it was made from, s.
    """

    point: Vec = field(eq=False)
    velocity: Vec = field(eq=False)
    yaw: float
    yaw_rate: float
    stamp: float


@frozen(kw_only=True)
class HandSettings:
    """What the mapping needs to know.

    Attributes:
        hand: The scenario's `[hand]`.
        low: (3,) lower corner that the mapped hand is clamped to, m.
        high: (3,) upper corner, m.
        radius: Distance of the outermost drone at rest, m.
    """

    hand: Hand
    low: Vec = field(eq=False)
    high: Vec = field(eq=False)
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
    yaw = sample.yaw if settings.hand.follow_yaw else 0.0
    if previous is None:
        capped = _capped(velocity, settings.hand.max_speed)
        return MappedHand(point=target, velocity=capped, yaw=yaw, yaw_rate=0.0, stamp=sample.stamp)
    dt = min(max(sample.stamp - previous.stamp, 0.0), MAX_SAMPLE_GAP)
    point, velocity = _chase(previous.point, target, velocity, settings.hand.max_speed, dt)
    turned, yaw_rate = _turn(previous.yaw, yaw, OUTERMOST_SPEED / max(settings.radius, 0.1), dt)
    return MappedHand(point=point, velocity=velocity, yaw=turned, yaw_rate=yaw_rate, stamp=sample.stamp)


def freeze(mapped: MappedHand) -> MappedHand:
    """Returns the mapped hand at rest where it is (HOLD, or the hand is silent)."""
    return evolve(mapped, velocity=np.zeros(3), yaw_rate=0.0)


def _target(sample: HandInput, settings: HandSettings) -> tuple[Vec, Vec]:
    """Applies mapping, fixed height and clamps; a clamped axis has no velocity."""
    hand = settings.hand
    point, velocity = sample.position, sample.velocity
    if hand.mapping == "relative":
        point = np.array(hand.offset) + hand.gain * point
        velocity = hand.gain * velocity
    if hand.height is not None:
        point = np.array([point[0], point[1], hand.height])
        velocity = np.array([velocity[0], velocity[1], 0.0])
    clamped = np.minimum(np.maximum(point, settings.low), settings.high)
    return clamped, np.where(clamped == point, velocity, 0.0)


def _chase(point: Vec, target: Vec, velocity: Vec, max_speed: float, dt: float) -> tuple[Vec, Vec]:
    """Moves towards the target by at most `max_speed * dt`; arriving, it takes over the hand's velocity."""
    way = target - point
    distance = math.sqrt(way @ way)
    if distance > max_speed * dt:
        heading = way / distance
        return point + heading * max_speed * dt, heading * max_speed
    return target, _capped(velocity, max_speed)


def _capped(velocity: Vec, max_speed: float) -> Vec:
    speed = math.sqrt(velocity @ velocity)
    return velocity if speed <= max_speed else velocity * (max_speed / speed)


def _turn(yaw: float, target: float, max_rate: float, dt: float) -> tuple[float, float]:
    way = math.remainder(target - yaw, 2.0 * math.pi)
    if abs(way) <= max_rate * dt:
        return target, way / dt if dt > 0.0 else 0.0
    rate = math.copysign(max_rate, way)
    return yaw + rate * dt, rate
