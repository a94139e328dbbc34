"""The cell list finds exactly the pairs that a search over all pairs finds."""

import itertools
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.cells import Cells, Place, near_pairs

ROOT = Path(__file__).resolve().parents[2]
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


CROWD = """
from agents.control.safety.encounter import Clearance, drone_heard
from shared.cells import Cells, Place
here, clearance = (0.0, 0.0, 0.0), Clearance(0.3, 1.0, 1.0)
for _ in range(3):
    Cells([Place(0.0, 0.0) for _ in range(20_000)], 1.0)
    Cells([drone_heard(here, here, here, 0.0, clearance, yields=True) for _ in range(20_000)], 1.0)
"""


@pytest.mark.timeout(60)
def test_a_crowd_in_one_cell_is_let_go_of() -> None:
    """Its chain is long: in compiled values that the collector does not know Python would write over memory."""
    subprocess.run([sys.executable, "-c", CROWD], cwd=ROOT, check=True, timeout=50)


def test_few_points_far_apart_make_few_cells() -> None:
    for far in (Place(1e6, 0.0), Place(1e6, 1e6)):
        assert len(Cells([Place(0.0, 0.0), far], 0.05).cells) <= 9
