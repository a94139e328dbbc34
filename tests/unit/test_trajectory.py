"""The reference trajectory: exact where it may be, never beyond its limits (agents/control/trajectory.py)."""

import itertools

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.trajectory import Trajectory, advance, limit, norm, start_at, tracking_velocity
from tests.hands import RATE_HZ, stroke

Vec = npt.NDArray[np.float64]

SPEED, ACCELERATION = 1.0, 3.0
TICK = 1.0 / RATE_HZ

coordinates = st.floats(-1_000.0, 1_000.0).map(lambda x: round(x, 6))
goals = st.tuples(coordinates, coordinates, coordinates)
steps = st.floats(1e-4, 0.05)


def track(trajectory: Trajectory, goal: Vec, dt: float) -> Trajectory:
    wanted = tracking_velocity(trajectory, goal, dt, ACCELERATION)
    return advance(trajectory, goal, wanted, dt, SPEED, ACCELERATION)


def fly(trajectory: Trajectory, moves: list[tuple[Vec, float]]) -> list[Trajectory]:
    """The trajectory at the start and after every (goal, dt)."""
    return list(itertools.accumulate(moves, lambda before, move: track(before, *move), initial=trajectory))


@pytest.mark.parametrize("rate", [60.0, 120.0])
@given(way=st.floats(1e-3, 4.0), heading=st.floats(-3.2, 3.2), climb=st.floats(-1.5, 1.5))
def test_a_resting_goal_is_reached_without_overshoot(
    rate: float, way: float, heading: float, climb: float
) -> None:
    ahead = np.array([np.cos(climb) * np.cos(heading), np.cos(climb) * np.sin(heading), np.sin(climb)])
    goal = way * ahead[None, :]
    flown = fly(start_at(np.zeros((1, 3))), [(goal, 1.0 / rate)] * round(rate * (way / SPEED + 2.0)))
    along = np.array([t.point[0] @ ahead for t in flown])
    assert along.max() <= way + 1e-3
    assert np.abs(np.array([t.point[0] for t in flown]) - np.outer(along, ahead)).max() <= 1e-9
    assert np.allclose(flown[-1].point, goal, atol=1e-6)
    assert np.allclose(flown[-1].velocity, 0.0, atol=1e-6)


def test_a_long_way_is_flown_at_full_speed_and_full_acceleration() -> None:
    flown = fly(start_at(np.zeros((1, 3))), [(np.array([[2.0, 0.0, 0.0]]), TICK)] * 240)
    speeds = np.array([t.velocity[0, 0] for t in flown])
    assert speeds[1] == pytest.approx(ACCELERATION * TICK)
    assert speeds.max() == pytest.approx(SPEED)
    # 2 m at 1 m/s, a third of a second to get going, less than half a second to brake.
    assert int(np.argmax(np.array([t.point[0, 0] for t in flown]) > 1.99)) * TICK < 2.6


@given(
    start=goals,
    moves=st.lists(st.tuples(goals, steps, st.integers(1, 20)), min_size=1, max_size=8),
    speed=st.floats(0.1, 3.0),
    acceleration=st.floats(0.1, 10.0),
)
def test_no_jump_of_the_goal_breaks_the_limits(
    start: tuple[float, ...],
    moves: list[tuple[tuple[float, ...], float, int]],
    speed: float,
    acceleration: float,
) -> None:
    now = start_at(np.array([start]))
    for goal, dt, times in moves:
        for _ in range(times):
            wanted = tracking_velocity(now, np.array([goal]), dt, acceleration)
            after = advance(now, np.array([goal]), wanted, dt, speed, acceleration)
            assert np.isfinite(after.point).all()
            assert norm(after.velocity)[0, 0] <= speed + 1e-9
            assert norm(after.velocity - now.velocity)[0, 0] <= acceleration * dt + 1e-9
            assert np.allclose(after.point - now.point, after.velocity * dt, atol=1e-9)
            now = after


@given(heading=st.floats(-3.2, 3.2), length=st.floats(0.1, 2.0), peak=st.floats(0.25, 0.75), start=goals)
def test_a_goal_within_the_limits_is_followed_exactly(
    heading: float, length: float, peak: float, start: tuple[float, ...]
) -> None:
    # A minimum-jerk stroke accelerates at most 5.77 L / T^2.
    peak = min(peak, 1.875 * np.sqrt(0.9 * ACCELERATION * length / 5.774))
    track_of_hand = np.array([s.position for s in stroke(heading, length, peak, after=0.2)])
    points = track_of_hand - track_of_hand[0] + np.array(start)
    flown = fly(start_at(points[:1]), [(point[None, :], TICK) for point in points])
    assert np.abs(np.array([t.point[0] for t in flown[1:]]) - points).max() <= 1e-9


def test_a_moving_goal_that_was_out_of_reach_is_caught_up_with() -> None:
    points = np.array([[0.5 + 0.4 * k * TICK, 0.0, 0.0] for k in range(240)])
    flown = fly(start_at(np.zeros((1, 3))), [(point[None, :], TICK) for point in points])
    assert np.abs(flown[30].point - points[29]).max() > 0.05
    assert np.abs(flown[-1].point - points[-1]).max() <= 1e-9
    assert flown[-1].velocity[0] == pytest.approx([0.4, 0.0, 0.0])


@given(first=goals, second=goals, dt=steps)
def test_drones_do_not_affect_each_other(
    first: tuple[float, ...], second: tuple[float, ...], dt: float
) -> None:
    start, goal = np.array([first, second]), np.array([second, first])
    together = fly(start_at(start), [(goal, dt)] * 5)[-1]
    for row in (0, 1):
        alone = fly(start_at(start[[row]]), [(goal[[row]], dt)] * 5)[-1]
        assert np.allclose(alone.point, together.point[[row]], atol=1e-12)


def test_a_trajectory_starts_at_rest_on_its_goal() -> None:
    points = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    started = start_at(points)
    assert started.point.tolist() == started.goal.tolist() == points.tolist()
    assert not started.velocity.any()
    assert not started.lead.any()
    assert track(started, points, TICK).point.tolist() == points.tolist()


def test_a_limit_shortens_only_what_is_too_long() -> None:
    vectors = np.array([[3.0, 4.0, 0.0], [0.3, 0.4, 0.0], [0.0, 0.0, 0.0]])
    assert limit(vectors, 1.0) == pytest.approx(np.array([[0.6, 0.8, 0.0], [0.3, 0.4, 0.0], [0.0, 0.0, 0.0]]))
    assert limit(vectors, np.array([[10.0], [0.05], [1.0]])) == pytest.approx(
        np.array([[3.0, 4.0, 0.0], [0.03, 0.04, 0.0], [0.0, 0.0, 0.0]])
    )
