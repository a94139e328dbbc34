"""The cell list finds exactly the pairs that a search over all pairs finds."""

import itertools

from hypothesis import given
from hypothesis import strategies as st

from shared.cells import Cells, Place, near_pairs

COORDINATE = st.floats(-4.0, 4.0)


@given(
    st.lists(st.tuples(COORDINATE, COORDINATE) | st.tuples(*[st.floats(-1e6, 1e6)] * 2), max_size=40),
    st.floats(0.05, 5.0),
)
def test_it_finds_what_all_pairs_find(points: list[tuple[float, float]], reach: float) -> None:
    near = {
        (one, other)
        for one, other in itertools.combinations(range(len(points)), 2)
        if (points[one][0] - points[other][0]) ** 2 + (points[one][1] - points[other][1]) ** 2 <= reach * reach
    }
    found = near_pairs(points, reach)
    assert len(found) == len(set(found))
    assert set(found) == near


def test_its_cost_does_not_grow_with_all_pairs() -> None:
    places = [Place(float(x), float(y)) for x in range(100) for y in range(100)]
    grid = Cells(places, 1.0)
    assert sum(len(grid.near(place)) for place in places) == 2 * 2 * 100 * 99
    assert max(map(_crowd, grid.cells)) <= 4


def _crowd(place: Place | None) -> int:
    return 0 if place is None else 1 + _crowd(place.after)


def test_few_points_far_apart_make_few_cells() -> None:
    for far in (Place(1e6, 0.0), Place(1e6, 1e6)):
        assert len(Cells([Place(0.0, 0.0), far], 0.05).cells) <= 9
