import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.projection import CENTRE, SWEPT_MARGIN, project_exact, project_swept

Vec = npt.NDArray[np.float64]

RADIUS = 0.27
CLEARANCE = RADIUS + SWEPT_MARGIN
ONE = np.zeros((1, 2))

coordinate = st.floats(-2.0, 2.0)
point = st.tuples(coordinate, coordinate)
columns = st.lists(point, max_size=6).map(lambda centres: np.array(centres).reshape(-1, 2))


def segment_distance(start: Vec, end: Vec, centre: Vec) -> float:
    along = np.linspace(0.0, 1.0, 201)[:, None]
    return float(np.linalg.norm(start + along * (end - start) - centre, axis=1).min())


@given(point)
def test_exact_moves_radially_onto_the_circle(wanted: tuple[float, float]) -> None:
    moved = project_exact(np.array(wanted), ONE, RADIUS)
    distance = math.hypot(*wanted)
    if distance >= RADIUS:
        assert np.array_equal(moved, wanted)
    else:
        assert np.linalg.norm(moved) == pytest.approx(RADIUS)
        assert distance <= CENTRE or np.dot(moved, wanted) >= distance * RADIUS * (1 - 1e-9)


def test_exact_leaves_a_centre_towards_plus_x() -> None:
    assert np.allclose(project_exact(np.zeros(2), ONE, RADIUS), (RADIUS, 0.0))


def test_exact_takes_the_columns_in_order() -> None:
    first, second = np.array([[0.0, 0.0]]), np.array([[0.4, 0.0]])
    start = np.array([0.1, 0.0])
    assert np.allclose(project_exact(start, np.vstack((first, second)), RADIUS), (0.13, 0.0))
    assert np.allclose(project_exact(start, np.vstack((second, first)), RADIUS), (0.27, 0.0))


def test_exact_is_vectorised_over_leading_axes() -> None:
    rng = np.random.default_rng(0)
    wanted, centres = rng.uniform(-1, 1, (4, 3, 2)), rng.uniform(-1, 1, (5, 2))
    single = [[project_exact(p, centres, RADIUS) for p in row] for row in wanted]
    assert np.array_equal(project_exact(wanted, centres, RADIUS), np.array(single))


@given(start=point, target=point, centres=columns, step=st.floats(0.001, 1.0))
def test_swept_is_short_and_never_nears_a_column(
    start: tuple[float, float], target: tuple[float, float], centres: Vec, step: float
) -> None:
    begin = np.array(start)
    end = project_swept(begin, np.array(target), centres, RADIUS, step=step)
    assert np.linalg.norm(end - begin) <= step * (1 + 1e-9)
    for centre in centres:
        allowed = min(CLEARANCE, float(np.linalg.norm(begin - centre)))
        assert segment_distance(begin, end, centre) >= allowed - 1e-6


def test_swept_reaches_a_free_target_straight() -> None:
    end = project_swept(np.zeros(2), np.array([0.01, 0.02]), np.array([[1.0, 1.0]]), RADIUS, step=0.5)
    assert np.allclose(end, (0.01, 0.02))


def test_swept_slides_around_a_column_that_exact_jumps_across() -> None:
    at, goals = np.array([-0.6, 0.1]), np.linspace((-0.6, 0.1), (0.6, 0.1), 200)
    exact = np.array([project_exact(goal, ONE, RADIUS) for goal in goals])
    swept = []
    for goal in np.vstack((goals, np.repeat(goals[-1:], 200, axis=0))):
        at = project_swept(at, goal, ONE, RADIUS, step=0.008)
        swept.append(at)
    assert np.linalg.norm(np.diff(exact, axis=0), axis=1).max() > 0.008
    assert np.linalg.norm(np.diff(swept, axis=0), axis=1).max() <= 0.008 + 1e-12
    assert np.linalg.norm(swept, axis=1).min() >= CLEARANCE - 1e-6
    assert np.allclose(swept[-1], goals[-1], atol=1e-6)


def test_swept_leaves_a_column_that_it_starts_in() -> None:
    at = np.array([0.1, 0.0])
    for _ in range(60):
        at = project_swept(at, np.array([-0.6, 0.0]), ONE, RADIUS, step=0.008)
    assert np.linalg.norm(at) >= CLEARANCE - 1e-6


def test_swept_handles_several_set_points_at_once() -> None:
    rng = np.random.default_rng(0)
    starts, targets, centres = (rng.uniform(-1, 1, (4, 2)) for _ in range(3))
    single = [project_swept(s, t, centres, RADIUS, step=0.05) for s, t in zip(starts, targets, strict=True)]
    assert np.allclose(project_swept(starts, targets, centres, RADIUS, step=0.05), single)
