"""Whether everything is where it fits: fence, formation, home, heights, hand and columns."""

import math
from collections import Counter
from collections.abc import Iterator

from shared.cylinders import columns_of
from shared.envelope import BODY
from shared.fence import fence_box, goal_box, hand_box, shape_box
from shared.formation import Formation
from shared.scenario import Pair, Scenario
from shared.scenario_check.finding import ROUNDING, Finding

LOWEST_FLIGHT = 0.2
"""Below this height a drone that takes off counts as having landed, m; one that follows is about to."""
START_ROOM = 0.05
"""Between a column's surface and a body that takes off beside it, m: it drifts a little while it climbs."""

FASTEST_WALKER = 1.5
"""Drones evade a hand, or a person, of at most this speed, m/s."""

_AXES = "xyz"


def check_room(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    """Yields what does not fit."""
    yield from _formation_fits(scenario, formation)
    yield from _home_fits(scenario, formation)
    yield from _heights_fit(scenario, formation)
    yield from _clip_fits(scenario, formation)
    yield from _columns_fit(scenario, formation)
    yield from _walkers_fit(scenario, formation)


def _formation_fits(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    low, high = goal_box(scenario, formation)
    lower, upper = shape_box(scenario, formation)
    for axis in range(2):
        there, needed = high[axis] - low[axis], upper[axis] - lower[axis]
        if needed > there + ROUNDING:
            turning = " at any heading" if scenario.hand.follow_yaw else ""
            yield Finding(
                "fence",
                f"the formation and its hand need {needed:.2f} m along {_AXES[axis]}{turning}, the fence leaves"
                f" {max(there, 0.0):.2f} m inside its margin of {scenario.fence.margin:g} m",
                f"widen fence.min and fence.max by {needed - there:.2f} m, or make the formation smaller",
            )


def _home_fits(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    low, high = fence_box(scenario, formation)
    for drone, (x, y) in zip(formation.ids, _starts(scenario, formation), strict=True):
        if not (low[0] <= x <= high[0] and low[1] <= y <= high[1]):
            yield Finding(
                "hand.home",
                f"drone {drone} begins at ({x:.2f}, {y:.2f}), outside the fence from"
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
    if takeoff < LOWEST_FLIGHT:
        yield Finding(
            "limits.takeoff_height",
            f"{takeoff:g} m is no flight: a drone at this height has landed",
            f"make it at least {LOWEST_FLIGHT:g} m",
        )
    if takeoff > highest:
        yield Finding(
            "limits.takeoff_height",
            f"{takeoff:g} m is above what the fence allows, {highest:.2f} m: a drone would climb for ever",
            "lower it, or raise fence.max",
        )
    heights = [z for _, _, z in formation.rest]
    lowest, tallest = min(heights), max(heights)
    least = max(floor, 0.0) + LOWEST_FLIGHT
    if hand is not None and not (hand + lowest >= least - ROUNDING and hand + tallest <= highest):
        yield Finding(
            "hand.height",
            f"the formation flies from {hand + lowest:.2f} to {hand + tallest:.2f} m high, ground and fence"
            f" allow {least:.2f} to {highest:.2f} m",
            "change it, or fence.max",
        )


def _clip_fits(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    if scenario.hand.clip is None:
        return
    (low, high), (base_low, base_high) = fence_box(scenario, formation), hand_box(scenario, formation)
    lower, upper = shape_box(scenario, formation)
    for axis in range(2):
        reach_low, reach_high = base_low[axis] + lower[axis], base_high[axis] + upper[axis]
        if reach_low < low[axis] - ROUNDING or reach_high > high[axis] + ROUNDING:
            yield Finding(
                "hand.clip",
                f"it lets the formation reach from {reach_low:.2f} to {reach_high:.2f} m along"
                f" {_AXES[axis]}, the fence from {low[axis]:.2f} to {high[axis]:.2f} m",
                "narrow the clip, or widen the fence",
            )


def _columns_fit(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    for name, times in Counter(column.name for column in scenario.obstacles).items():
        if times > 1:
            yield Finding("obstacles", f"the name {name!r} appears {times} times", "give each its own")
    starts = _starts(scenario, formation)
    for column, cylinder in zip(scenario.obstacles, columns_of(scenario), strict=True):
        needed = cylinder.radius + BODY + START_ROOM
        gaps = [math.dist(start, (column.x, column.y)) for start in starts]
        nearest = min(gaps)
        if nearest < needed:
            yield Finding(
                "obstacles",
                f"column {column.name!r} stands {nearest:.2f} m from where drone"
                f" {formation.ids[gaps.index(nearest)]}"
                f" begins, less than {needed:.2f} m",
                "move the column, or hand.home",
            )


def _starts(scenario: Scenario, formation: Formation) -> list[Pair]:
    """Returns where the drones begin, m."""
    home_x, home_y = scenario.hand.home
    return [(home_x + x, home_y + y) for x, y, _ in formation.rest]


def _walkers_fit(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    (home_x, home_y), keep = scenario.hand.home, BODY + START_ROOM
    starts = [(home_x + x, home_y + y) for x, y, _ in formation.rest]
    for walker in scenario.walkers:
        if walker.speed > FASTEST_WALKER:
            yield Finding(
                "walkers",
                f"{walker.name!r} walks at {walker.speed:g} m/s, drones evade at most {FASTEST_WALKER:g} m/s",
                "slow down",
            )
        gaps = [math.dist(walker.path[0], start) for start in starts]
        nearest = gaps.index(min(gaps))
        if gaps[nearest] < walker.radius + keep:
            yield Finding(
                "walkers",
                f"{walker.name!r} stands {gaps[nearest]:.2f} m from where drone {formation.ids[nearest]}"
                f" begins, less than {walker.radius + keep:.2f} m",
                "let the path begin elsewhere, or move hand.home",
            )
