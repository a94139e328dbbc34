"""The nearest point under linear demands, against a search that knows nothing of how it is found."""

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.safety.halfplanes import HalfPlane, nearest

Vec = npt.NDArray[np.float64]

LIMIT = 5.0
TURNS = np.linspace(0.0, 2.0 * math.pi, 721)[:-1]
RINGS = np.linspace(0.0, LIMIT, 101)
GRID = np.array([(r * math.cos(a), r * math.sin(a)) for r in RINGS for a in TURNS])

ANGLES = st.floats(-math.pi, math.pi)
POINTS = st.tuples(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0))
PLANES = st.builds(
    lambda angle, least: HalfPlane(math.cos(angle), math.sin(angle), least), ANGLES, st.floats(-6.0, 6.0)
)
RANKS = st.lists(st.lists(PLANES, max_size=5), min_size=1, max_size=3)


def lacks(planes: list[HalfPlane], points: Vec) -> Vec:
    """How much the most violated of some demands lacks at each point; 0 where all are met."""
    worst = np.zeros(len(points))
    for plane in planes:
        worst = np.maximum(worst, plane.least - points @ np.array([plane.x, plane.y]))
    return worst


@given(POINTS, RANKS)
def test_no_point_of_a_grid_is_better(wanted: tuple[float, float], ranks: list[list[HalfPlane]]) -> None:
    point, met = nearest(wanted, ranks, LIMIT)
    found = np.array([point])
    assert math.hypot(*point) <= LIMIT + 1e-6
    every = [plane for rank in ranks for plane in rank]
    inside = GRID[lacks(every, GRID) <= 0.0]
    if met:
        assert float(lacks(every, found)[0]) <= 1e-6
        assert math.dist(point, wanted) <= np.linalg.norm(inside - wanted, axis=1).min(initial=np.inf) + 1e-6
    else:
        assert not len(inside)
    # Among the points that violate the ranks before as little as it does, none violates a rank less.
    points = GRID
    for rank in ranks:
        lacking = float(lacks(rank, found)[0])
        assert lacking <= lacks(rank, points).min(initial=np.inf) + 1e-6
        points = points[lacks(rank, points) <= lacking]


@given(POINTS, st.lists(PLANES, max_size=8))
def test_the_order_within_a_rank_does_not_matter(wanted: tuple[float, float], planes: list[HalfPlane]) -> None:
    one, met = nearest(wanted, [planes], LIMIT)
    other, also = nearest(wanted, [planes[::-1]], LIMIT)
    assert met == also or float(lacks(planes, np.array([one, other])).max()) < 1e-6
    if met and also:
        assert one == pytest.approx(other, abs=1e-4)


@given(POINTS, st.lists(PLANES, max_size=6), ANGLES)
def test_it_turns_with_its_world(wanted: tuple[float, float], planes: list[HalfPlane], angle: float) -> None:
    c, s = math.cos(angle), math.sin(angle)

    def turned(x: float, y: float) -> tuple[float, float]:
        return (c * x - s * y, s * x + c * y)

    point, met = nearest(wanted, [planes], LIMIT)
    again, also = nearest(turned(*wanted), [[HalfPlane(*turned(p.x, p.y), p.least) for p in planes]], LIMIT)
    if met and also:
        assert again == pytest.approx(turned(*point), abs=1e-4)


def test_without_demands_it_is_what_is_wanted_as_far_as_possible() -> None:
    assert nearest((3.0, 4.0), [[]], LIMIT) == ((3.0, 4.0), True)
    assert nearest((6.0, 8.0), [], LIMIT) == ((3.0, 4.0), True)


def test_one_demand_moves_the_point_onto_its_edge() -> None:
    point, met = nearest((-1.0, 2.0), [[HalfPlane(1.0, 0.0, 0.5)]], LIMIT)
    assert point == pytest.approx((0.5, 2.0))
    assert met


def test_between_two_that_contradict_each_other_it_goes_in_the_middle() -> None:
    apart = [HalfPlane(1.0, 0.0, 2.0), HalfPlane(-1.0, 0.0, 1.0)]
    point, met = nearest((0.0, 3.0), [apart], LIMIT)
    assert point == pytest.approx((0.5, 3.0))
    assert not met


def test_a_rank_gives_nothing_to_those_after_it() -> None:
    point, met = nearest((0.0, 3.0), [[HalfPlane(1.0, 0.0, 2.0)], [HalfPlane(-1.0, 0.0, 1.0)]], LIMIT)
    assert point == pytest.approx((2.0, 3.0))
    assert not met


def test_a_demand_beyond_the_limit_is_met_as_far_as_the_limit_goes() -> None:
    point, met = nearest((0.0, 0.0), [[HalfPlane(0.6, 0.8, 9.0)]], LIMIT)
    assert point == pytest.approx((3.0, 4.0), abs=1e-4)
    assert not met


def test_a_thousand_demands_that_hold_are_looked_at_once() -> None:
    angles = np.linspace(-1.5, 1.5, 1000)
    planes = [HalfPlane(math.cos(a), math.sin(a), -1.0) for a in angles]
    assert nearest((1.0, 0.0), [planes], LIMIT) == ((1.0, 0.0), True)
