"""Neighbour search with a cell list, in numpy: pairs of points nearer than a reach, without all pairs."""

import numpy as np
import numpy.typing as npt

Vec = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]


def near_pairs(points: Vec, groups: Rows, reach: float) -> tuple[Rows, Rows]:
    """Finds the pairs within reach.

    Args:
        points: (n, 2) m.
        groups: (n,) numbers >= 0; only points of one group make pairs.
        reach: m, > 0.

    Returns:
        Rows of both points of each ordered pair: (i, j) and (j, i).
    """
    cell = np.floor((points - points.min(axis=0)) / reach).astype(np.intp) + 1
    columns, rows = cell.max(axis=0) + 2
    key = (groups * columns + cell[:, 0]) * rows + cell[:, 1]
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    found = []
    for side in (-rows, 0, rows):
        # The cells below, level with and above a point have consecutive keys.
        first = np.searchsorted(ordered, key + side - 1, side="left")
        count = np.searchsorted(ordered, key + side + 1, side="right") - first
        one = np.repeat(np.arange(len(points)), count)
        within = np.arange(len(one)) - np.repeat(np.cumsum(count) - count, count)
        found.append((one, order[np.repeat(first, count) + within]))
    one, other = (np.concatenate(rows) for rows in zip(*found, strict=True))
    gaps = points[one] - points[other]
    near = (np.einsum("ki,ki->k", gaps, gaps) <= reach * reach) & (one != other)
    return one[near], other[near]
