"""Formations and flights as arrays, for whoever looks at them as a whole; whoever flies needs none of it."""

import numpy as np
import numpy.typing as npt

from shared.formation import Formation

Vec = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


def rest_of(formation: Formation) -> Vec:
    """Returns the rest shape (N, 3) relative to the mapped hand, formation frame, m."""
    return np.array(formation.rest)


def offsets_of(formation: Formation) -> Vec:
    """Returns the places (N, 3) relative to the weighted references, formation frame, m."""
    return np.array(formation.offsets)


def weights_of(formation: Formation) -> Vec:
    """Returns the reference weights (N, N + 1) over `[human, drones...]`."""
    matrix = np.zeros((len(formation.ids), len(formation.ids) + 1))
    for row, weights in enumerate(formation.weights):
        for column, weight in weights.items():
            matrix[row, column] = weight
    return matrix


def stretches(mask: Mask) -> list[slice]:
    """Returns the stretches of a mask (T,) that are true throughout, in order."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [slice(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]
