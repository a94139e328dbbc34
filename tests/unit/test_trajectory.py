"""The reference trajectory: exact where it may be, never beyond its limits (agents/control/trajectory.py)."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.trajectory import Trajectory, advance, approach, start_at, tracking_velocity
from agents.control.vectors import ORIGIN, Vector, distance, norm
from tests.hands import RATE_HZ, stroke

SPEED, ACCELERATION = 1.0, 3.0
TICK = 1.0 / RATE_HZ

coordinates = st.floats(-1_000.0, 1_000.0).map(lambda x: round(x, 6))
goals = st.tuples(coordinates, coordinates, coordinates)
steps = st.floats(1e-4, 0.05)


def track(before: Trajectory, goal: Vector, dt: float, speed: float, acceleration: float) -> Trajectory:
    wanted = tracking_velocity(before, goal, dt, acceleration)
    point, velocity = advance(before, wanted, dt, speed, acceleration)
    return Trajectory(point, velocity, before.lead, goal)


def fly(start: Vector, moves: list[tuple[Vector, float]]) -> list[Trajectory]:
    """The trajectory at the start and after every (goal, dt)."""
    return list(
        itertools.accumulate(
            moves,
            lambda before, move: track(before, move[0], move[1], SPEED, ACCELERATION),
            initial=start_at(start),
        )
    )


@pytest.mark.parametrize("rate", [60.0, 120.0])
@given(way=st.floats(1e-3, 4.0), heading=st.floats(-3.2, 3.2), climb=st.floats(-1.5, 1.5))
def test_a_resting_goal_is_reached_without_overshoot(
    rate: float, way: float, heading: float, climb: float
) -> None:
    ahead = np.array([np.cos(climb) * np.cos(heading), np.cos(climb) * np.sin(heading), np.sin(climb)])
    x, y, z = (way * ahead).tolist()
    flown = fly(ORIGIN, [((x, y, z), 1.0 / rate)] * round(rate * (way / SPEED + 2.0)))
    points = np.array([t.point for t in flown])
    along = points @ ahead
    assert along.max() <= way + 1e-3
    assert np.abs(points - np.outer(along, ahead)).max() <= 1e-9
    assert flown[-1].point == pytest.approx((x, y, z), abs=1e-6)
    assert flown[-1].velocity == pytest.approx(ORIGIN, abs=1e-6)


def test_a_long_way_is_flown_at_full_speed_and_full_acceleration() -> None:
    flown = fly(ORIGIN, [((2.0, 0.0, 0.0), TICK)] * 240)
    speeds = [t.velocity[0] for t in flown]
    assert speeds[1] == pytest.approx(ACCELERATION * TICK)
    assert max(speeds) == pytest.approx(SPEED)
    # 2 m at 1 m/s, a third of a second to get going, less than half a second to brake.
    assert next(k for k, t in enumerate(flown) if t.point[0] > 1.99) * TICK < 2.6


@given(
    start=goals,
    moves=st.lists(st.tuples(goals, steps, st.integers(1, 20)), min_size=1, max_size=8),
    speed=st.floats(0.1, 3.0),
    acceleration=st.floats(0.1, 10.0),
)
def test_no_jump_of_the_goal_breaks_the_limits(
    start: Vector, moves: list[tuple[Vector, float, int]], speed: float, acceleration: float
) -> None:
    now = start_at(start)
    for goal, dt, times in moves:
        for _ in range(times):
            after = track(now, goal, dt, speed, acceleration)
            assert all(map(math.isfinite, after.point))
            assert norm(after.velocity) <= speed + 1e-9
            assert distance(after.velocity, now.velocity) <= acceleration * dt + 1e-9
            moved = np.subtract(after.point, now.point)
            assert np.allclose(moved, np.multiply(after.velocity, dt), atol=1e-9)
            now = after


@given(heading=st.floats(-3.2, 3.2), length=st.floats(0.1, 2.0), peak=st.floats(0.25, 0.75), start=goals)
def test_a_goal_within_the_limits_is_followed_exactly(
    heading: float, length: float, peak: float, start: Vector
) -> None:
    # A minimum-jerk stroke accelerates at most 5.77 L / T^2.
    peak = min(peak, 1.875 * np.sqrt(0.9 * ACCELERATION * length / 5.774))
    track_of_hand = np.array([s.position for s in stroke(heading, length, peak, after=0.2)])
    points = track_of_hand - track_of_hand[0] + np.array(start)
    moves = [((x, y, z), TICK) for x, y, z in points.tolist()]
    flown = fly(moves[0][0], moves)
    assert np.abs(np.array([t.point for t in flown[1:]]) - points).max() <= 1e-9


def test_a_moving_goal_that_was_out_of_reach_is_caught_up_with() -> None:
    points = [(0.5 + 0.4 * k * TICK, 0.0, 0.0) for k in range(240)]
    flown = fly(ORIGIN, [(point, TICK) for point in points])
    assert distance(flown[30].point, points[29]) > 0.05
    assert distance(flown[-1].point, points[-1]) <= 1e-9
    assert flown[-1].velocity == pytest.approx((0.4, 0.0, 0.0))


def test_a_trajectory_starts_at_rest_on_its_goal() -> None:
    started = start_at((1.0, 2.0, 3.0))
    assert started.point == started.goal == (1.0, 2.0, 3.0)
    assert started.velocity == started.lead == ORIGIN
    assert track(started, (1.0, 2.0, 3.0), TICK, SPEED, ACCELERATION).point == (1.0, 2.0, 3.0)


def test_a_velocity_changes_only_as_far_as_it_may() -> None:
    assert approach(ORIGIN, (3.0, 4.0, 0.0), 1.0) == pytest.approx((0.6, 0.8, 0.0))
    assert approach((1.0, 1.0, 1.0), (1.3, 1.4, 1.0), 1.0) == pytest.approx((1.3, 1.4, 1.0))
