"""The cell list finds exactly the pairs that a search over all pairs finds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.cells import near_pairs

COORDINATE = st.floats(-4.0, 4.0)


@given(
    st.lists(st.tuples(COORDINATE, COORDINATE, st.integers(0, 2)), min_size=1, max_size=40),
    st.floats(0.05, 5.0),
)
def test_it_finds_what_all_pairs_find(placed: list[tuple[float, float, int]], reach: float) -> None:
    points = np.array([(x, y) for x, y, _ in placed])
    groups = np.array([group for _, _, group in placed], dtype=np.intp)
    one, other = near_pairs(points, groups, reach)
    gaps = points[:, None] - points
    near = np.einsum("ijk,ijk->ij", gaps, gaps) <= reach * reach
    near &= (groups[:, None] == groups) & ~np.eye(len(points), dtype=bool)
    assert sorted(zip(one.tolist(), other.tolist(), strict=True)) == sorted(
        map(tuple, np.argwhere(near).tolist())
    )


def test_its_cost_does_not_grow_with_all_pairs() -> None:
    side = np.arange(100.0)
    points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    one, _ = near_pairs(points, np.zeros(len(points), dtype=np.intp), 1.0)
    assert len(one) == 2 * 2 * 100 * 99
    assert np.bincount(one).max() == pytest.approx(4)
