"""One law: what a drone computes in floats is its row of what a batch computes in arrays, to 1e-12."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from msgspec.structs import asdict

from agents.control import avoidance as many_avoidance
from agents.control import goals as many_goals
from agents.control import impedance as many_links
from agents.control import steering as many_steering
from agents.control import trajectory as many_trajectory
from agents.control.avoidance import COLUMN_BUBBLE, DRONE_BUBBLE, HAND_BUBBLE, Encounters
from agents.control.hand import MappedHand
from agents.control.single import avoidance, goals, impedance, steering, trajectory, vectors
from agents.control.single.avoidance import Encounter
from agents.control.single.vectors import Planar, Vector
from agents.settings import single_steering_settings, steering_settings
from shared.config import load_scenario
from shared.formation import build_formation
from shared.messages import Mode
from shared.scenario import Avoidance

Vec = npt.NDArray[np.float64]

TICK = 1.0 / 60.0


def box(limit: float) -> st.SearchStrategy[Vector]:
    return st.tuples(*[st.floats(-limit, limit)] * 3)


PLACES, SPEEDS = box(2.0), box(1.5)
PLANAR = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
OTHERS: st.SearchStrategy[list[Encounter]] = st.lists(
    st.tuples(*[st.floats(-0.8, 0.8)] * 4) | st.tuples(*[st.floats(-3.0, 3.0)] * 4), max_size=5
)
STEPS = st.floats(1e-4, 0.05)
YAWS = st.just(0.0) | st.floats(-7.0, 7.0)
BUBBLES = st.sampled_from([DRONE_BUBBLE, HAND_BUBBLE, COLUMN_BUBBLE])
FIELDS = st.sampled_from([Avoidance().columns, Avoidance().separation])
TRAJECTORIES = st.builds(trajectory.Trajectory, PLACES, SPEEDS, SPEEDS, PLACES) | PLACES.map(
    trajectory.start_at
)


def same(single: Any, many: Any) -> bool:
    return np.allclose(single, np.asarray(many).reshape(np.shape(single)), rtol=1e-12, atol=1e-12)


def row(values: Sequence[float]) -> Vec:
    return np.array([values], dtype=np.float64)


def in_arrays(one: trajectory.Trajectory) -> many_trajectory.Trajectory:
    return many_trajectory.Trajectory(**{name: row(value) for name, value in asdict(one).items()})


def pairs(others: Sequence[Encounter]) -> Encounters:
    table = np.array(others, dtype=np.float64).reshape(-1, 4)
    return Encounters(row=np.zeros(len(table), dtype=np.intp), position=table[:, :2], velocity=table[:, 2:])


def assume_off_the_edges(point: Planar, velocity: Planar, others: Sequence[Encounter]) -> None:
    """Where a bubble or a field begins, or right on the line of approach, a rounding may decide."""
    for x, y, u, v in others:
        dx, dy = point[0] - x, point[1] - y
        distance = math.hypot(dx, dy)
        assume(distance > 1e-6)
        closing = ((u - velocity[0]) * dx + (v - velocity[1]) * dy) / distance
        across = ((v - velocity[1]) * dx - (u - velocity[0]) * dy) / distance
        assume(abs(across) > 1e-9 and abs(closing - many_avoidance.STANDSTILL) > 1e-9)
        for bubble in (DRONE_BUBBLE, HAND_BUBBLE, COLUMN_BUBBLE):
            assume(abs(bubble.radius + bubble.lead * max(closing, 0.0) - distance) > 1e-9)
        for field in (Avoidance().columns, Avoidance().separation):
            assume(abs(field.radius + field.d0 - distance) > 1e-9)


@given(PLACES, st.floats(1e-3, 3.0), YAWS)
def test_vectors(one: Vector, largest: float, yaw: float) -> None:
    assert same(vectors.norm(one), many_trajectory.norm(row(one)))
    assert same(vectors.shorten(one, largest), many_trajectory.limit(row(one), largest))
    assert same(vectors.rotate(one, yaw), many_goals.rotate(row(one), yaw))
    assert same(
        vectors.clamp(one, (-1.0, -0.5, 0.0), (1.0, 0.5, 0.7)), np.clip(one, [-1, -0.5, 0], [1, 0.5, 0.7])
    )


@pytest.mark.parametrize("law", ["paper", "stable"])
@given(
    drone=st.integers(1, 4),
    moves=st.lists(st.tuples(SPEEDS, STEPS), min_size=1, max_size=20),
    points=st.lists(PLACES, min_size=3, max_size=3),
    speeds=st.lists(SPEEDS, min_size=3, max_size=3),
    yaw=YAWS,
    yaw_rate=st.floats(-1.0, 1.0),
)
def test_links_and_goals(
    law: str,
    drone: int,
    moves: list[tuple[Vector, float]],
    points: list[Vector],
    speeds: list[Vector],
    yaw: float,
    yaw_rate: float,
) -> None:
    formation = build_formation(
        load_scenario("rhombus", [f"swarm.law={law}", 'impedance.links=[{name="2-4", limit=0.05, gain=-20.0}]'])
    )
    one, many = goals.drone_row(formation, drone), many_goals.agent_row(formation, drone)
    alone: tuple[impedance.LinkState, ...] = (impedance.AT_REST,) * len(one.links)
    together = many_links.rest_state(len(one.links))
    for velocity, dt in moves:
        alone = impedance.step_links(alone, one.links, velocity, dt)
        together = many_links.step_links(
            together, many_links.transition_rows(one.links, dt), np.array(velocity)
        )
    assert same([link.displacement for link in alone], together.displacement)
    assert same([link.rate for link in alone], together.rate)

    mine, rate = goals.correction(one, alone)
    theirs, their_rate = many_goals.corrections(many, together)
    assert same(mine, theirs)
    assert same(rate, their_rate)
    human, *others = list(zip(points, speeds, strict=True))[: len(one.weights)]
    hand = MappedHand(point=human[0], velocity=human[1], yaw=yaw, yaw_rate=yaw_rate, stamp=0.0)
    lead = [goals.Guide(point, velocity, Mode.FOLLOW) for point, velocity in others]
    goal, goal_velocity = goals.goal_of(one, alone, hand, lead, None)
    seen = [np.array(vectors[: len(one.weights)]) for vectors in (points, speeds)]
    assert same(goal, many_goals.goals(many, seen[0], theirs, yaw))
    moving = many_goals.place_velocities(many, theirs, their_rate, yaw, yaw_rate)
    assert same(goal_velocity, many_goals.goal_velocities(many, seen[1], moving))


@given(TRAJECTORIES, PLACES, SPEEDS, STEPS, st.floats(0.1, 3.0), st.floats(0.1, 10.0))
def test_trajectory(
    one: trajectory.Trajectory, goal: Vector, wanted: Vector, dt: float, speed: float, acceleration: float
) -> None:
    many = in_arrays(one)
    assert same(
        trajectory.tracking_velocity(one, goal, dt, acceleration),
        many_trajectory.tracking_velocity(many, row(goal), dt, acceleration),
    )
    point, velocity = trajectory.advance(one, wanted, dt, speed, acceleration)
    together = many_trajectory.advance(many, row(goal), row(wanted), dt, speed, acceleration)
    assert same(point, together.point)
    assert same(velocity, together.velocity)


@given(PLANAR, PLANAR, OTHERS, PLANAR, BUBBLES, FIELDS)
def test_avoidance(
    point: Planar, velocity: Planar, others: list[Encounter], wanted: Planar, bubble: Any, field: Any
) -> None:
    assume_off_the_edges(point, velocity, others)
    many = pairs(others)
    assert same(avoidance.separation(point, others, field), many_avoidance.separation(row(point), many, field))
    alone = avoidance.threats(point, velocity, others, bubble)
    together = many_avoidance.threats(row(point), row(velocity), many, bubble)
    assert same([threat.heading for threat in alone], together.heading)
    assert same([threat.needed for threat in alone], together.needed)
    assert same([threat.direction for threat in alone], together.direction)
    assert same(avoidance.escape(wanted, alone), many_avoidance.escape(row(wanted), together))

    columns = [(x, y) for x, y, _, _ in others]
    if columns:
        attracted, near = avoidance.column_velocity(point, wanted, columns, field, 2.0)
        pulled, acting = many_avoidance.column_velocity(row(point), row(wanted), many.position, field, 2.0)
        assert same(attracted, pulled)
        assert near == acting[0, 0]
        close = avoidance.columns_near(point, velocity, columns, bubble)
        near_ones = many_avoidance.columns_near(row(point), row(velocity), many.position, bubble)
        assert [each[:2] for each in close] == [tuple(each) for each in near_ones.position.tolist()]


def test_on_top_of_each_other_both_leave_along_x() -> None:
    here: Planar = (0.5, -0.5)
    on_top = [(*here, 0.3, 0.1)]
    field = Avoidance().separation
    assert same(
        avoidance.separation(here, on_top, field), many_avoidance.separation(row(here), pairs(on_top), field)
    )
    alone = avoidance.threats(here, (0.0, 0.0), on_top, DRONE_BUBBLE)
    together = many_avoidance.threats(row(here), row((0.0, 0.0)), pairs(on_top), DRONE_BUBBLE)
    assert alone[0].heading == (1.0, 0.0)
    assert same(alone[0].direction, together.direction)
    assert same(alone[0].needed, together.needed)


COLUMNS = 'obstacles=[{name="a", x=-0.3, y=0.4}, {name="b", x=0.5, y=-0.2}]'
RULES = {
    "free": [],
    "columns": [COLUMNS],
    "projection": [COLUMNS, "avoidance.rule=projection"],
    "fence": ["fence.min=[-1.0, -0.6, -0.1]", "fence.max=[0.6, 0.6, 1.0]"],
    "fenced columns": [COLUMNS, "fence.min=[-1.0, -0.6, -0.1]", "fence.max=[0.6, 0.6, 1.0]"],
}


@pytest.mark.parametrize("law", ["paper", "stable"])
@pytest.mark.parametrize("rules", RULES)
@given(
    start=TRAJECTORIES,
    goal=PLACES,
    goal_velocity=SPEEDS,
    position=PLACES,
    velocity=SPEEDS,
    others=OTHERS,
    hand=st.none() | st.tuples(*[st.floats(-1.5, 1.5)] * 4),
    hand_speed=st.floats(0.0, 2.0),
    dt=STEPS | st.floats(1e-9, 30.0),
)
def test_steering(
    law: str,
    rules: str,
    start: trajectory.Trajectory,
    goal: Vector,
    goal_velocity: Vector,
    position: Vector,
    velocity: Vector,
    others: list[Encounter],
    hand: Encounter | None,
    hand_speed: float,
    dt: float,
) -> None:
    scenario = load_scenario("rhombus", [f"swarm.law={law}", *RULES[rules]])
    formation = build_formation(scenario)
    alone = single_steering_settings(scenario, formation, 1)
    everything = [*others, *([hand] if hand else []), *((x, y, 0.0, 0.0) for x, y in alone.columns)]
    assume_off_the_edges(position[:2], velocity[:2], everything)
    assume_off_the_edges(start.point[:2], start.velocity[:2], everything)
    around = steering.Surroundings(position, velocity, others, hand, hand_speed)
    one = steering.steer(start, goal, goal_velocity, around, alone, dt)
    many = many_steering.steer(
        in_arrays(start),
        row(goal),
        row(goal_velocity),
        many_steering.Surroundings(
            position=row(position),
            velocity=row(velocity),
            drones=pairs(others),
            hand=pairs([hand]) if hand else None,
            hand_speed=hand_speed,
        ),
        steering_settings(scenario, formation, (1,)),
        dt,
    )
    # Wanted velocities are ways divided by dt: what they are rounded to grows with it.
    assert np.allclose(one.setpoint, many.setpoint[0], rtol=1e-12, atol=1e-12)
    for name, value in asdict(one.trajectory).items():
        assert np.allclose(value, getattr(many.trajectory, name)[0], rtol=1e-12, atol=1e-12), name
    assert (one.avoiding, one.fenced) == (many.avoiding[0, 0], many.fenced[0, 0])
