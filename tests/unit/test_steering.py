"""Steering one drone: within the limits, inside the fence, off the others (agents/control/steering.py)."""

import functools
import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.avoidance import DRONE_BUBBLE, Encounter
from agents.control.steering import (
    ESCAPE_ACCELERATION,
    HAND_SPEED_FACTOR,
    LONGEST_STEP,
    Bystander,
    Steered,
    SteeringSettings,
    Surroundings,
    steer,
)
from agents.control.trajectory import Trajectory, start_at
from agents.control.vectors import ORIGIN, Vector, distance, norm
from agents.settings import steering_settings
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


PLACES, SPEEDS = box(2.0), box(1.5)
ENCOUNTERS = st.builds(Encounter, *[st.floats(-0.8, 0.8)] * 4) | st.builds(
    Encounter, *[st.floats(-3.0, 3.0)] * 4
)
TRAJECTORIES = st.builds(Trajectory, PLACES, box(0.5), box(0.5), PLACES) | PLACES.map(start_at)
AROUND = st.builds(
    Surroundings,
    PLACES,
    SPEEDS,
    st.lists(ENCOUNTERS, max_size=5),
    st.lists(st.builds(Bystander, *[st.floats(-0.8, 0.8)] * 2, st.floats(0.35, 0.6)), max_size=2),
    st.lists(ENCOUNTERS, max_size=1),
    st.floats(0.0, 2.0),
)
STEPS = st.floats(1e-4, LONGEST_STEP)


@functools.cache
def settings(law: str, rules: str) -> SteeringSettings:
    scenario = load_scenario("rhombus", [f"swarm.law={law}", *RULES[rules]])
    return steering_settings(scenario, build_formation(scenario), 1)


@EVERY
@given(TRAJECTORIES, PLACES, SPEEDS, AROUND, STEPS | st.floats(1e-9, 30.0))
def test_no_step_breaks_the_limits(
    law: str, rules: str, before: Trajectory, goal: Vector, velocity: Vector, around: Surroundings, dt: float
) -> None:
    rule = settings(law, rules)
    steered = steer(before, goal, velocity, around, rule, dt)
    now, hardest = (
        steered.trajectory,
        rule.acceleration * ESCAPE_ACCELERATION * max(min(dt, LONGEST_STEP), 1e-4),
    )
    assert (
        norm(now.velocity)
        <= max(rule.speed, HAND_SPEED_FACTOR * around.hand_speed, norm(before.velocity)) + 1e-9
    )
    assert distance(now.velocity, before.velocity) <= hardest + 1e-9
    assert distance(now.lead, before.lead) <= hardest + 1e-9
    for point in (now.point, steered.setpoint, now.goal):
        assert all(low <= x <= high for low, x, high in zip(rule.low, point, rule.high, strict=True))


def alone(position: Vector, *others: Encounter, hand: Encounter | None = None) -> Surroundings:
    return Surroundings(position, ORIGIN, [*others], [], [hand] if hand else [], 0.0)


@pytest.mark.parametrize("law", LAWS)
@given(start=PLACES, way=box(0.01))
def test_with_nobody_in_the_way_a_goal_in_reach_is_reached_at_once(
    law: str, start: Vector, way: Vector
) -> None:
    (x, y, z), (u, v, w) = start, way
    goal = (x + 0.04 * u, y + 0.04 * v, abs(z + 0.04 * w))
    steered = steer(start_at((x, y, abs(z))), goal, ORIGIN, alone(start), settings(law, "free"), TICK)
    assert steered.trajectory.point == pytest.approx(goal, abs=1e-9)
    assert not steered.avoiding
    assert not steered.fenced


@given(velocity=box(0.4))
def test_the_stable_law_leads_by_the_goals_velocity_and_the_papers_not_at_all(velocity: Vector) -> None:
    point = (0.1, 0.0, 1.2)
    for law, share in (("stable", 1.0), ("paper", 0.0)):
        rule, now = settings(law, "free"), Trajectory(point, ORIGIN, ORIGIN, point)
        for _ in range(60):
            steered = steer(now, point, velocity, alone(point), rule, TICK)
            now = steered.trajectory
        leading = [x + rule.tau * share * u for x, u in zip(point, velocity, strict=True)]
        assert steered.setpoint == pytest.approx(leading, abs=1e-9)


@EVERY
@given(st.floats(-math.pi, math.pi), st.booleans())
def test_who_comes_near_is_left_and_reported(law: str, rules: str, heading: float, is_hand: bool) -> None:
    here = (0.0, 0.0, 0.6)
    other = Encounter(0.25 * math.cos(heading), 0.25 * math.sin(heading), 0.0, 0.0)
    around = alone(here, hand=other) if is_hand else alone(here, other)
    steered = steer(start_at(here), here, ORIGIN, around, settings(law, rules), TICK)
    x, y, _ = steered.setpoint
    assert steered.avoiding
    if rules == "free":
        assert math.hypot(x - other.x, y - other.y) > 0.25


def same(one: Steered, other: Steered) -> bool:
    return fields(one.trajectory) == fields(other.trajectory) and one.setpoint == other.setpoint


@pytest.mark.parametrize("law", LAWS)
@given(TRAJECTORIES, PLACES, SPEEDS, AROUND)
def test_who_is_far_away_changes_nothing(
    law: str, before: Trajectory, goal: Vector, velocity: Vector, around: Surroundings
) -> None:
    """A flock leaves them out."""
    x, y, _ = around.position
    reach = (
        DRONE_BUBBLE.radius
        + DRONE_BUBBLE.lead * (norm(around.velocity) + 3.0)
        + distance(before.point, around.position)
    )
    far = Encounter(x + reach + 0.5, y, -2.0, 0.5)
    seen = fields(around)
    crowded = Surroundings(**{**seen, "drones": [*around.drones, far]})
    rule = settings(law, "free")
    assert same(
        steer(before, goal, velocity, around, rule, TICK), steer(before, goal, velocity, crowded, rule, TICK)
    )
