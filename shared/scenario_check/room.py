"""Whether everything is where it fits: fence, formation, home, heights, hand and columns."""

from collections import Counter
from collections.abc import Iterator

import numpy as np

from shared.fence import fence_box, goal_box, hand_box, shape_box
from shared.formation import Formation, Vec
from shared.scenario import Scenario
from shared.scenario_check.finding import Finding

LOWEST_TAKEOFF = 0.2
"""Below this height a drone that takes off counts as having landed, m."""
BODY = 0.06
"""Half the distance at which two bodies touch, m."""
START_ROOM = 0.05
"""Between a column's surface and a body that takes off beside it, m: it drifts a little while it climbs."""

_ROUNDING = 1e-9
_AXES = "xyz"


def check_room(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    """Yields what does not fit."""
    yield from _formation_fits(scenario, formation)
    yield from _home_fits(scenario, formation)
    yield from _heights_fit(scenario, formation)
    yield from _clip_fits(scenario, formation)
    yield from _columns_fit(scenario, formation)


def _formation_fits(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    low, high = goal_box(scenario, formation)
    lower, upper = shape_box(scenario, formation)
    for axis in range(2):
        there, needed = high[axis] - low[axis], upper[axis] - lower[axis]
        if needed > there + _ROUNDING:
            turning = " at any heading" if scenario.hand.follow_yaw else ""
            yield Finding(
                "fence",
                f"the formation and its hand need {needed:.2f} m along {_AXES[axis]}{turning}, the fence leaves"
                f" {max(there, 0.0):.2f} m inside its margin of {scenario.fence.margin:g} m",
                f"widen fence.min and fence.max by {needed - there:.2f} m, or make the formation smaller",
            )


def _home_fits(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    low, high = fence_box(scenario, formation)
    home = np.array(scenario.hand.home)
    for drone, place in zip(formation.ids, home + formation.rest[:, :2], strict=True):
        if (place < low[:2]).any() or (place > high[:2]).any():
            yield Finding(
                "hand.home",
                f"drone {drone} begins at ({place[0]:.2f}, {place[1]:.2f}), outside the fence from"
                f" ({low[0]:.2f}, {low[1]:.2f}) to ({high[0]:.2f}, {high[1]:.2f})",
                "move hand.home or the fence",
            )
            return


def _heights_fit(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    (_, _, floor), (_, _, roof) = fence_box(scenario, formation)
    highest = roof - scenario.fence.margin
    takeoff, hand = scenario.limits.takeoff_height, scenario.hand.height
    if floor > 0.0:
        yield Finding(
            "fence.min",
            f"the fence begins {floor:.2f} m above the ground, where the drones stand",
            "let its height be 0 or less",
        )
    if takeoff < LOWEST_TAKEOFF:
        yield Finding(
            "limits.takeoff_height",
            f"{takeoff:g} m is no flight: a drone at this height has landed",
            f"make it at least {LOWEST_TAKEOFF:g} m",
        )
    if takeoff > highest:
        yield Finding(
            "limits.takeoff_height",
            f"{takeoff:g} m is above what the fence allows, {highest:.2f} m: a drone would climb for ever",
            "lower it, or raise fence.max",
        )
    lowest, tallest = formation.rest[:, 2].min(), formation.rest[:, 2].max()
    if hand is not None and not (hand + lowest > max(floor, 0.0) and hand + tallest <= highest):
        yield Finding(
            "hand.height",
            f"the formation flies from {hand + lowest:.2f} to {hand + tallest:.2f} m high, the fence allows"
            f" {max(floor, 0.0):.2f} to {highest:.2f} m",
            "change it, or fence.max",
        )


def _clip_fits(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    if scenario.hand.clip is None:
        return
    (low, high), (base_low, base_high) = fence_box(scenario, formation), hand_box(scenario, formation)
    lower, upper = shape_box(scenario, formation)
    reach_low, reach_high = (base_low + lower)[:2], (base_high + upper)[:2]
    for axis in range(2):
        if reach_low[axis] < low[axis] - _ROUNDING or reach_high[axis] > high[axis] + _ROUNDING:
            yield Finding(
                "hand.clip",
                f"it lets the formation reach from {reach_low[axis]:.2f} to {reach_high[axis]:.2f} m along"
                f" {_AXES[axis]}, the fence from {low[axis]:.2f} to {high[axis]:.2f} m",
                "narrow the clip, or widen the fence",
            )


def _columns_fit(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    for name, times in Counter(column.name for column in scenario.obstacles).items():
        if times > 1:
            yield Finding("obstacles", f"the name {name!r} appears {times} times", "give each its own")
    places: Vec = np.array(scenario.hand.home) + formation.rest[:, :2]
    needed = scenario.avoidance.columns.radius + BODY + START_ROOM
    for column in scenario.obstacles:
        gaps = np.hypot(*(places - (column.x, column.y)).T)
        nearest = int(np.argmin(gaps))
        if gaps[nearest] < needed:
            yield Finding(
                "obstacles",
                f"column {column.name!r} stands {gaps[nearest]:.2f} m from where drone {formation.ids[nearest]}"
                f" begins, less than {needed:.2f} m",
                "move the column, or hand.home",
            )
