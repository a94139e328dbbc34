"""Steering one drone: within the limits, inside the fence, off the others (agents/control/steering.py)."""

import functools
import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.safety.encounter import Clearance, Encounter, drone_heard, walker_seen
from agents.control.safety.motion import Motion, start_motion
from agents.control.steering import (
    HAND_SPEED_FACTOR,
    LONGEST_STEP,
    Steered,
    SteeringSettings,
    Surroundings,
    steer,
)
from agents.control.trajectory import Trajectory, start_at
from agents.control.vectors import ORIGIN, Vector, distance, norm
from agents.settings import clearances, steering_settings, widest
from shared.config import load_scenario
from shared.formation import build_formation
from tests.values import fields

TICK = 1.0 / 60.0
COLUMNS = 'obstacles=[{name="a", x=-0.3, y=0.4}, {name="b", x=0.5, y=-0.2}]'
FENCE = ("fence.min=[-1.0, -0.6, -0.1]", "fence.max=[0.6, 0.6, 1.0]")
RULES: dict[str, tuple[str, ...]] = {
    "free": (),
    "columns": (COLUMNS,),
    "projection": (COLUMNS, "avoidance.rule=projection"),
    "fence": FENCE,
    "fenced columns": (COLUMNS, *FENCE),
}
LAWS = ("paper", "stable")
EVERY = pytest.mark.parametrize(("law", "rules"), [*itertools.product(LAWS, RULES)])


def box(limit: float) -> st.SearchStrategy[Vector]:
    return st.tuples(*[st.floats(-limit, limit)] * 3)


@functools.cache
def settings(law: str, rules: str) -> SteeringSettings:
    scenario = load_scenario("rhombus", [f"swarm.law={law}", *RULES[rules]])
    return steering_settings(scenario, build_formation(scenario), 1)


@functools.cache
def clearance() -> Clearance:
    scenario = load_scenario("rhombus")
    return widest(clearances(scenario, build_formation(scenario), 1))


def drone(point: Vector, pace: Vector = ORIGIN) -> Encounter:
    return drone_heard(point, pace, ORIGIN, 0.0, clearance(), yields=True)


def hand(point: Vector, pace: Vector = ORIGIN) -> Encounter:
    return walker_seen(point, pace, 0.0, 0.0, settings("paper", "free").safety.hand)


PLACES, SPEEDS = box(2.0), box(1.5)
NEAR, ANYWHERE = (box(0.8), box(0.8)), (box(3.0), box(3.0))
DRONES = st.builds(drone, *NEAR) | st.builds(drone, *ANYWHERE)
HANDS = st.builds(hand, *NEAR) | st.builds(hand, *ANYWHERE)
TRAJECTORIES = st.builds(Trajectory, PLACES, box(0.5), box(0.5), PLACES) | PLACES.map(start_at)
MOTIONS = st.builds(start_motion, PLACES, SPEEDS, st.just(0.0))
AROUND = st.builds(Surroundings, st.lists(DRONES, max_size=5), st.lists(HANDS, max_size=1), st.floats(0.0, 2.0))
STEPS = st.floats(1e-4, LONGEST_STEP)


@EVERY
@given(TRAJECTORIES, MOTIONS, PLACES, SPEEDS, AROUND, STEPS | st.floats(1e-9, 30.0), st.booleans())
def test_no_step_breaks_the_limits(
    law: str,
    rules: str,
    before: Trajectory,
    motion: Motion,
    goal: Vector,
    velocity: Vector,
    around: Surroundings,
    dt: float,
    floor: bool,
) -> None:
    rule = settings(law, rules)
    steered = steer(before, motion, goal, velocity, around, rule, dt, floor=floor)
    now, guarded = steered.trajectory, steered.guarded
    hardest = rule.acceleration * max(min(dt, LONGEST_STEP), 1e-4)
    for point in (guarded.setpoint, now.goal):
        assert all(low <= x <= high for low, x, high in zip(rule.low, point, rule.high, strict=True))
    if guarded.planar or guarded.upright:
        assert all(map(math.isfinite, (*now.point, *now.velocity, *now.lead)))
        return
    fastest = max(rule.speed, HAND_SPEED_FACTOR * around.hand_speed, norm(before.velocity))
    assert norm(now.velocity) <= fastest + 1e-9
    assert distance(now.velocity, before.velocity) <= hardest + 1e-9
    assert distance(now.lead, before.lead) <= hardest + 1e-9
    assert all(low <= x <= high for low, x, high in zip(rule.low, now.point, rule.high, strict=True))


def rested(
    position: Vector, *others: Encounter, hands: tuple[Encounter, ...] = ()
) -> tuple[Motion, Surroundings]:
    return start_motion(position, ORIGIN, 0.0), Surroundings([*others], [*hands], 0.0)


@pytest.mark.parametrize("law", LAWS)
@given(start=PLACES, way=box(0.01))
def test_with_nobody_in_the_way_a_goal_in_reach_is_reached_at_once(
    law: str, start: Vector, way: Vector
) -> None:
    (x, y, z), (u, v, w) = start, way
    here = (x, y, 0.3 + abs(z))
    goal = (x + 0.04 * u, y + 0.04 * v, 0.3 + abs(z + 0.04 * w))
    motion, around = rested(here)
    steered = steer(start_at(here), motion, goal, ORIGIN, around, settings(law, "free"), TICK, floor=True)
    assert steered.trajectory.point == pytest.approx(goal, abs=1e-9)
    assert not steered.avoiding
    assert not steered.fenced


@given(velocity=box(0.4))
def test_the_stable_law_leads_by_the_goals_velocity_and_the_papers_not_at_all(velocity: Vector) -> None:
    point = (0.1, 0.0, 1.2)
    for law, share in (("stable", 1.0), ("paper", 0.0)):
        rule, now = settings(law, "free"), Trajectory(point, ORIGIN, ORIGIN, point)
        for _ in range(60):
            motion, around = rested(point)
            steered = steer(now, motion, point, velocity, around, rule, TICK, floor=True)
            now = steered.trajectory
        leading = [x + rule.tau * share * u for x, u in zip(point, velocity, strict=True)]
        assert steered.guarded.setpoint == pytest.approx(leading, abs=1e-9)


@EVERY
@given(st.floats(-math.pi, math.pi), st.booleans())
def test_who_comes_near_is_left_and_reported(law: str, rules: str, heading: float, is_hand: bool) -> None:
    here = (0.0, 0.0, 0.6)
    there = (0.25 * math.cos(heading), 0.25 * math.sin(heading), 0.6)
    motion, around = rested(here, hands=(hand(there),)) if is_hand else rested(here, drone(there))
    steered = steer(start_at(here), motion, here, ORIGIN, around, settings(law, rules), TICK, floor=True)
    assert steered.avoiding
    if rules == "free":
        assert math.dist(steered.guarded.setpoint, there) > 0.25


def same(one: Steered, other: Steered) -> bool:
    return (
        fields(one.trajectory) == fields(other.trajectory)
        and one.guarded.setpoint == other.guarded.setpoint
        and one.guarded.kept == other.guarded.kept
    )


@pytest.mark.parametrize("law", LAWS)
@given(TRAJECTORIES, MOTIONS, PLACES, SPEEDS, AROUND)
def test_who_is_far_away_changes_nothing(
    law: str, before: Trajectory, motion: Motion, goal: Vector, velocity: Vector, around: Surroundings
) -> None:
    """A flock leaves them out."""
    rule = settings(law, "free")
    safety, closing = rule.safety, abs(motion.x.velocity) + abs(motion.y.velocity) + 2.0
    needed = safety.horizontal.acceleration / safety.planar.rate + 2.0 * (closing + clearance().surprise)
    reach = clearance().distance + safety.planar.gap_for(needed) + distance(before.point, goal)
    far = drone((motion.x.position + reach + 0.5, motion.y.position, motion.z.position), (-2.0, 0.0, 0.0))
    crowded = Surroundings([*around.drones, far], around.walkers, around.hand_speed)
    one, other = (
        steer(before, motion, goal, velocity, seen, rule, TICK, floor=True) for seen in (around, crowded)
    )
    if one.guarded.kept:
        assert same(one, other)
