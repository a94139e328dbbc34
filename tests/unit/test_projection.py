import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.projection import CENTRE, SWEPT_MARGIN, project_exact, project_swept
from agents.control.vectors import Planar

RADIUS = 0.27
CLEARANCE = RADIUS + SWEPT_MARGIN
ONE: tuple[Planar, ...] = ((0.0, 0.0),)

coordinate = st.floats(-2.0, 2.0)
point = st.tuples(coordinate, coordinate)
columns = st.lists(point, max_size=6).map(tuple)


def segment_distance(start: Planar, end: Planar, centre: Planar) -> float:
    along = np.linspace(0.0, 1.0, 201)[:, None]
    return float(np.linalg.norm(start + along * np.subtract(end, start) - centre, axis=1).min())


@given(point)
def test_exact_moves_radially_onto_the_circle(wanted: tuple[float, float]) -> None:
    moved = project_exact(wanted, ONE, RADIUS)
    distance = math.hypot(*wanted)
    if distance >= RADIUS:
        assert moved == wanted
    else:
        assert math.hypot(*moved) == pytest.approx(RADIUS)
        assert distance <= CENTRE or np.dot(moved, wanted) >= distance * RADIUS * (1 - 1e-9)


def test_exact_leaves_a_centre_towards_plus_x() -> None:
    assert np.allclose(project_exact((0.0, 0.0), ONE, RADIUS), (RADIUS, 0.0))


def test_exact_takes_the_columns_in_order() -> None:
    first, second = (0.0, 0.0), (0.4, 0.0)
    assert np.allclose(project_exact((0.1, 0.0), (first, second), RADIUS), (0.13, 0.0))
    assert np.allclose(project_exact((0.1, 0.0), (second, first), RADIUS), (0.27, 0.0))


@given(start=point, target=point, centres=columns, step=st.floats(0.001, 1.0))
def test_swept_is_short_and_never_nears_a_column(
    start: tuple[float, float], target: tuple[float, float], centres: tuple[Planar, ...], step: float
) -> None:
    end = project_swept(start, target, centres, RADIUS, step)
    assert math.dist(start, end) <= step * (1 + 1e-9)
    for centre in centres:
        allowed = min(CLEARANCE, math.dist(start, centre))
        assert segment_distance(start, end, centre) >= allowed - 1e-6


def test_swept_reaches_a_free_target_straight() -> None:
    start = (
        0.1,
        -0.3,
    )  # what the way there is rounded to must not make of a free target one that is in the way
    assert project_swept(start, (0.11, -0.17), ((1.0, 1.0),), RADIUS, 0.5) == (0.11, -0.17)


def test_swept_slides_around_a_column_that_exact_jumps_across() -> None:
    at, goals = (-0.6, 0.1), [(x, 0.1) for x in np.linspace(-0.6, 0.6, 200).tolist()]
    exact = np.array([project_exact(goal, ONE, RADIUS) for goal in goals])
    swept = []
    for goal in goals + goals[-1:] * 200:
        at = project_swept(at, goal, ONE, RADIUS, 0.008)
        swept.append(at)
    assert np.linalg.norm(np.diff(exact, axis=0), axis=1).max() > 0.008
    assert np.linalg.norm(np.diff(swept, axis=0), axis=1).max() <= 0.008 + 1e-12
    assert np.linalg.norm(swept, axis=1).min() >= CLEARANCE - 1e-6
    assert np.allclose(swept[-1], goals[-1], atol=1e-6)


def test_swept_leaves_a_column_that_it_starts_in() -> None:
    at = (0.1, 0.0)
    for _ in range(60):
        at = project_swept(at, (-0.6, 0.0), ONE, RADIUS, 0.008)
    assert math.hypot(*at) >= CLEARANCE - 1e-6
