"""The box that no drone leaves, and what a body in it can do."""

from shared.envelope import envelope_of
from shared.formation import Formation
from shared.messages import ORIGIN, Vector
from shared.plausibility import MotionLimits, body_limits
from shared.scenario import Scenario

UNLIMITED = 1e3
"""Bound of a height that nothing bounds, m."""
Box = tuple[Vector, Vector]
"""Lower and upper corner, m."""

_CEILING = 2.0
"""Height of an automatic fence above the take-off height, m."""


def fence_box(scenario: Scenario, formation: Formation) -> Box:
    """Returns the fence in the world frame.

    A corner that the scenario does not give lies `fence.room` around the rest formation at home, wherever it
    may turn to; the floor is at z = -0.1 (a landed drone is inside).
    """
    fence = scenario.fence
    x, y = scenario.hand.home
    (a, b, _), (c, d, _) = shape_box(scenario, formation)
    low = (x + a - fence.room, y + b - fence.room, -0.1)
    high = (x + c + fence.room, y + d + fence.room, scenario.limits.takeoff_height + _CEILING)
    return (low if fence.min is None else fence.min, high if fence.max is None else fence.max)


def bodies_of(scenario: Scenario, formation: Formation) -> MotionLimits:
    """Returns what the bodies of a swarm can do, for those who hear where they are said to be."""
    low, high = fence_box(scenario, formation)
    fastest = max(scenario.limits.speed, scenario.hand.max_speed, scenario.limits.takeoff_speed)
    envelopes = [envelope_of(scenario, drone) for drone in formation.ids]
    axes = [axis for envelope in envelopes for axis in (envelope.horizontal, envelope.vertical)]
    return body_limits(
        low,
        high,
        fastest,
        acceleration=max(axis.acceleration for axis in axes),
        lag=max(axis.lag for axis in axes),
    )


def goal_box(scenario: Scenario, formation: Formation) -> Box:
    """Returns the box that goals stay in: the fence less its margin.

    The ground is no fence to keep away from: a drone lands on it.
    """
    (a, b, c), (d, e, f) = fence_box(scenario, formation)
    margin = scenario.fence.margin
    return (a + margin, b + margin, c), (d - margin, e - margin, f - margin)


def hand_box(scenario: Scenario, formation: Formation) -> Box:
    """Returns the box of the mapped hand that keeps the whole goal formation in the fence.

    The formation may turn about the hand, so the box leaves its radius free unless the heading is fixed. The
    clip of the scenario, where there is one, replaces the box (the recorded flights clip the base alone).
    """
    clip = scenario.hand.clip
    if clip is not None:
        return (*clip.min, -UNLIMITED), (*clip.max, UNLIMITED)
    (a, b, c), (d, e, f) = goal_box(scenario, formation)
    (i, j, k), (m, n, o) = shape_box(scenario, formation)
    (x0, x1), (y0, y1), (z0, z1) = _span(a - i, d - m), _span(b - j, e - n), _span(c - k, f - o)
    return (x0, y0, z0), (x1, y1, z1)


def _span(low: float, high: float) -> tuple[float, float]:
    """Returns both; where a fence is too small for the formation it leaves one point: the middle."""
    middle = (low + high) / 2.0
    return min(low, middle), max(high, middle)


def shape_box(scenario: Scenario, formation: Formation) -> Box:
    """Returns the box of the rest formation and its hand, relative to the mapped hand.

    Where the formation follows the hand's yaw it is the box of all its headings.
    """
    x, y, z = zip(ORIGIN, *formation.rest, strict=True)
    if scenario.hand.follow_yaw:
        r = formation.radius
        return (-r, -r, min(z)), (r, r, max(z))
    return (min(x), min(y), min(z)), (max(x), max(y), max(z))
