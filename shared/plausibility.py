"""Whether something can have moved as it is said to have. Pure: time is passed in.

A body, or a hand, moves at a bounded speed. Whoever claims more is mistaken or lies, and is not believed until
the time that has passed would have been enough. A claim that is kept up is believed in the end, so a body that
was carried, fell, started anew elsewhere or was not heard for a while is never refused for good.

How far something may have come is a budget: it grows with the time that passed on the *receiver's* clock and is
spent by moving, so many small jumps get nobody further than one large one. Stamps of the sender grant nothing.
"""

import math
from dataclasses import dataclass
from typing import Final, final

from shared.clock import NS_PER_S
from shared.errors import DecodeError
from shared.messages import Vector

NOWHERE: Vector = (-math.inf, -math.inf, -math.inf)
UNBOUNDED: Vector = (math.inf, math.inf, math.inf)

BODY_SPEED, FALL_SPEED = 5.0, 10.0
"""A small drone that is blown away or falls indoors is no faster, m/s."""
MARGIN = 4.0
"""Nor is one that follows: it overshoots, and goes faster where it has to catch up or to escape."""
LONGEST_LOOK: Final = 0.25
"""A pose is no older than this when one looks ahead from it, s."""
AHEAD_SLACK, PACE_SLACK, ASKED_SLACK = 0.1, 0.1, 0.01
"""How far a point ahead, its pace and its acceleration may be off what a vehicle can do, m, m/s, m/s^2."""
BEYOND_FENCE = 2.0
"""How far out of the fence a body may get, m: it may be pushed, carried or badly tracked."""


@final
@dataclass(frozen=True, kw_only=True)
class MotionLimits:
    """What is possible.

    Attributes:
        speed: Largest horizontal speed, m/s.
        vertical_speed: Largest vertical speed, m/s; a body falls faster than it flies.
        slack: How far one may seem to move at once, m: noise, and samples that were held up and came together.
        low: Lower corner of where it can be, m.
        high: Upper corner, m.
        acceleration: Largest that a vehicle can be asked for along any axis, m/s^2.
        lag: Longest time from what is asked for to what happens, s.
    """

    speed: float
    vertical_speed: float
    slack: float
    low: Vector = NOWHERE
    high: Vector = UNBOUNDED
    acceleration: float = math.inf
    lag: float = 0.0


HAND_LIMITS = MotionLimits(speed=10.0, vertical_speed=10.0, slack=0.3)
"""No reach of an arm is faster. Where a hand may be is up to the mapping, which clamps it."""


def body_limits(
    low: Vector, high: Vector, fastest: float, *, acceleration: float = math.inf, lag: float = 0.0
) -> MotionLimits:
    """Returns what is possible for the body of a drone.

    Args:
        low: Lower corner of the fence, m.
        high: Upper corner, m.
        fastest: Largest speed that anybody may be asked to fly at, m/s.
        acceleration: The same, m/s^2.
        lag: Longest time from what is asked for to what happens, s.
    """
    (a, b, c), (d, e, f) = low, high
    return MotionLimits(
        speed=max(BODY_SPEED, MARGIN * fastest),
        vertical_speed=max(FALL_SPEED, MARGIN * fastest),
        slack=0.5,
        low=(a - BEYOND_FENCE, b - BEYOND_FENCE, c - BEYOND_FENCE),
        high=(d + BEYOND_FENCE, e + BEYOND_FENCE, f + BEYOND_FENCE),
        acceleration=acceleration,
        lag=lag,
    )


@final
class Believed:
    """What was believed last.

    Attributes:
        position: m.
        at_ns: When, on the receiver's clock (of a source that has good stamps: on its clock).
        reach: What is left of the slack, m.
    """

    def __init__(self, position: Vector, at_ns: int, reach: float) -> None:
        self.position: Final = position
        self.at_ns: Final = at_ns
        self.reach: Final = reach


def check_possible(position: Vector, velocity: Vector, limits: MotionLimits) -> None:
    """Refuses a place or a velocity that cannot be, whatever was before.

    Args:
        position: m.
        velocity: m/s.
        limits: What is possible.

    Raises:
        DecodeError: `outside` (the place) or `too-fast` (the velocity).
    """
    x, y, z = position
    a, b, c = limits.low
    d, e, f = limits.high
    if not (a <= x <= d and b <= y <= e and c <= z <= f):
        raise DecodeError(
            "outside", f"at {_said(position)} m, not within {_said(limits.low)} to {_said(limits.high)}"
        )
    u, v, w = velocity
    if not _length(u, v, w * limits.speed / limits.vertical_speed) <= limits.speed:
        raise DecodeError("too-fast", f"{_said(velocity)} m/s")


def check_ahead(
    position: Vector, velocity: Vector, ahead: Vector, pace: Vector, asked: Vector, limits: MotionLimits
) -> None:
    """Refuses a point ahead (docs/safety.md) that is not where a body can be soon, going on as it does.

    Others keep off that point, and the less the faster it says that it goes away, and is asked to.

    Args:
        position: Of the body, m.
        velocity: The same, m/s.
        ahead: The point, m.
        pace: Its velocity, m/s.
        asked: Its acceleration, m/s^2.
        limits: What is possible.

    Raises:
        DecodeError: `outside`, `too-fast`, `too-hard` or `unreachable`.
    """
    check_possible(ahead, pace, limits)
    p, q, r = asked
    if not max(abs(p), abs(q), abs(r)) <= limits.acceleration + ASKED_SLACK:
        raise DecodeError("too-hard", f"asked for {_said(asked)} m/s^2")
    a, b, c = velocity
    u, v, w = pace
    answer = limits.lag + LONGEST_LOOK
    if not max(abs(u - a), abs(v - b), abs(w - c)) <= limits.acceleration * answer + PACE_SLACK:
        raise DecodeError("too-hard", f"at {_said(velocity)}, and soon at {_said(pace)} m/s")
    x, y, z = position
    i, j, k = ahead
    way = _off_line(i - x, j - y, k - z, velocity, answer)
    if not way <= AHEAD_SLACK:
        raise DecodeError("unreachable", f"at {_said(position)}, and soon at {_said(ahead)} m")


def _off_line(x: float, y: float, z: float, velocity: Vector, longest: float) -> float:
    """Returns how far a way is from one that leads along a velocity for so long at most, m.

    Across and upwards vehicles answer after times of their own.
    """
    u, v, w = velocity
    square = u * u + v * v
    across = min(max((x * u + y * v) / square, 0.0), longest) if square > 0.0 else 0.0
    up = min(max(z / w, 0.0), longest) if w != 0.0 else 0.0
    return _length(x - across * u, y - across * v, z - up * w)


def believe(
    known: Believed | None, position: Vector, velocity: Vector, at_ns: int, limits: MotionLimits
) -> Believed:
    """Believes a position and a velocity, or refuses them.

    Args:
        known: What was believed last; None before the first, which may be anywhere within the limits.
        position: What is said now, m.
        velocity: The same, m/s.
        at_ns: When, on the clock of `known`.
        limits: What is possible.

    Returns:
        What to keep for the next call.

    Raises:
        DecodeError: `outside` (not within the limits), `too-fast` (the velocity) or `jump` (it cannot have come
            there from where it was). Keep `known`: the next claim is judged by it, with more time passed.
    """
    check_possible(position, velocity, limits)
    if known is None:
        return Believed(position, at_ns, limits.slack)
    x, y, z = position
    p, q, r = known.position
    way = _length(x - p, y - q, (z - r) * limits.speed / limits.vertical_speed)
    passed = at_ns - known.at_ns
    reach = known.reach + limits.speed * passed / NS_PER_S if passed > 0 else known.reach
    if not way <= reach:
        raise DecodeError(
            "jump", f"from {_said(known.position)} to {_said(position)} m within {passed / NS_PER_S:.3f} s"
        )
    return Believed(position, at_ns, min(reach - way, limits.slack))


def _length(x: float, y: float, z: float) -> float:
    return math.sqrt(x * x + y * y + z * z)


def _said(vector: Vector) -> str:
    return "({:.2f}, {:.2f}, {:.2f})".format(*vector)
