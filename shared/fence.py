"""The box that no drone leaves, and what a body in it can do."""

import numpy as np

from shared.formation import Formation, Vec
from shared.plausibility import MotionLimits, body_limits
from shared.scenario import Scenario

UNLIMITED = 1e3
"""Bound of a height that nothing bounds, m."""
_CEILING = 2.0
"""Height of an automatic fence above the take-off height, m."""


def fence_box(scenario: Scenario, formation: Formation) -> tuple[Vec, Vec]:
    """Returns the lower and upper corner (3,) of the fence in the world frame, m.

    A corner that the scenario does not give lies `fence.room` around the rest formation at home, wherever it
    may turn to; the floor is at z = -0.1 (a landed drone is inside).
    """
    fence = scenario.fence
    home = np.array([*scenario.hand.home, 0.0])
    lower, upper = shape_box(scenario, formation)
    low, high = home + lower - fence.room, home + upper + fence.room
    low[2], high[2] = -0.1, scenario.limits.takeoff_height + _CEILING
    return (
        np.array(fence.min) if fence.min is not None else low,
        np.array(fence.max) if fence.max is not None else high,
    )


def bodies_of(scenario: Scenario, formation: Formation) -> MotionLimits:
    """Returns what the bodies of a swarm can do, for those who hear where they are said to be."""
    low, high = fence_box(scenario, formation)
    (a, b, c), (d, e, f) = low.tolist(), high.tolist()
    fastest = max(scenario.limits.speed, scenario.hand.max_speed, scenario.limits.takeoff_speed)
    return body_limits((a, b, c), (d, e, f), fastest)


def goal_box(scenario: Scenario, formation: Formation) -> tuple[Vec, Vec]:
    """Returns the box (3,), (3,) that goals stay in: the fence less its margin, m.

    The ground is no fence to keep away from: a drone lands on it.
    """
    low, high = fence_box(scenario, formation)
    margin = scenario.fence.margin
    return low + np.array([margin, margin, 0.0]), high - margin


def hand_box(scenario: Scenario, formation: Formation) -> tuple[Vec, Vec]:
    """Returns the box (3,), (3,) of the mapped hand that keeps the whole goal formation in the fence, m.

    The formation may turn about the hand, so the box leaves its radius free unless the heading is fixed. The
    clip of the scenario, where there is one, replaces the box (the recorded flights clip the base alone).
    """
    clip = scenario.hand.clip
    if clip is not None:
        return np.array([*clip.min, -UNLIMITED]), np.array([*clip.max, UNLIMITED])
    low, high = goal_box(scenario, formation)
    lower, upper = shape_box(scenario, formation)
    low, high = low - lower, high - upper
    # A fence too small for the formation leaves one point: its middle.
    middle = (low + high) / 2.0
    return np.minimum(low, middle), np.maximum(high, middle)


def shape_box(scenario: Scenario, formation: Formation) -> tuple[Vec, Vec]:
    """Returns lower and upper corner (3,) of the rest formation and its hand, relative to the mapped hand, m.

    Where the formation follows the hand's yaw it is the box of all its headings.
    """
    shape = np.vstack([formation.rest, np.zeros(3)])
    lower, upper = shape.min(axis=0), shape.max(axis=0)
    if scenario.hand.follow_yaw:
        lower[:2], upper[:2] = -formation.radius, formation.radius
    return lower, upper
