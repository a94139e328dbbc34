"""What the operator may feel of a formation: area, neighbour distances, shift of its centroid (paper 5.2).

Pure. All of it is planar: formations are flat, and heights only ring with the altitude loops. How the numbers
become extended, contracted, growing, left or right is a rule (`glove_bridge.rules`). A drone that is not heard
is left out of the formation *and* of the default that it is compared with: what is missing is named, never
averaged away.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from attrs import field, frozen

from shared.arrays import Vec, rest_of
from shared.formation import Formation
from shared.geometry import hull_area

_ON_CIRCLE = 1e-6
"""Slack of the neighbour test, relative: drones exactly on the circle, as in a grid, count as inside."""

_NO_AREA = 1e-6
"""Formations of less area, as lines are, have no area to be compared with, m^2."""


@frozen(kw_only=True)
class Reading:
    """The state of a formation by one rule.

    Attributes:
        area: Area of the drones' convex hull, m^2.
        area_ratio: Over that of the default formation; 1 where that is a line.
        distances: Distance per neighbouring pair of ids, m.
        extent: -1 contracted, 0 regular, +1 extended.
        trend: -1 shrinking, 0 steady, +1 growing.
        displacement: Shift of the centroid to the right, m.
        side: -1 left, 0 neither, +1 right: the displacement, if it is large enough to be told.
    """

    area: float
    area_ratio: float
    distances: dict[tuple[int, int], float]
    extent: int
    trend: int
    displacement: float
    side: int


class Memory(NamedTuple):
    """What a rule remembers from one reading to the next.

    Attributes:
        trend: The last trend, for its hysteresis.
        heading: Unit vector of the last clear direction of motion, None before the first.
    """

    trend: int = 0
    heading: tuple[float, float] | None = None


@frozen(kw_only=True)
class Scene:
    """The drones that are heard, at one moment; world frame, rows in the order of the geometry's ids.

    Attributes:
        position: (n, 2) bodies, m.
        velocity: (n, 2) m/s.
        goal: (n, 2) where the control law wants them, before avoidance, m.
        setpoint: (n, 2) what their vehicles are told, m.
        yaw: Heading of the formation frame about z, rad.
    """

    position: Vec = field(eq=False)
    velocity: Vec = field(eq=False)
    goal: Vec = field(eq=False)
    setpoint: Vec = field(eq=False)
    yaw: float

    @property
    def forward(self) -> Vec:
        """(2,) unit vector in which the operator looks: -x of the formation frame."""
        return -np.array((math.cos(self.yaw), math.sin(self.yaw)))

    @property
    def rotation(self) -> Vec:
        """(2, 2) rotation from the formation frame to the world."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.array(((c, -s), (s, c)))


@frozen(kw_only=True)
class Geometry:
    """The default formation of those drones that are heard.

    Attributes:
        ids: Their numbers, n >= 1.
        rest: (n, 2) rest shape relative to the mapped hand, formation frame, m.
        rooted: Rows of those that refer to the human alone: their goals say where the mapped hand is.
        pairs: (p, 2) rows of neighbours.
        gaps: (p,) their distances at rest, m.
        area: Area at rest, m^2.
    """

    ids: tuple[int, ...]
    rest: Vec = field(eq=False)
    rooted: tuple[int, ...]
    pairs: tuple[tuple[int, int], ...]
    gaps: Vec = field(eq=False)
    area: float

    def by_pair(self, distances: Vec) -> dict[tuple[int, int], float]:
        """Names distances (p,) by the ids of their pairs."""
        ids = self.ids
        return {(ids[i], ids[j]): d for (i, j), d in zip(self.pairs, distances.tolist(), strict=True)}


def default_geometry(formation: Formation, ids: Sequence[int]) -> Geometry:
    """Returns the default formation of some of its drones.

    Args:
        formation: The whole formation.
        ids: Those that are heard, at least one.
    """
    rows = [formation.row(drone) for drone in ids]
    rest = rest_of(formation)[rows, :2]
    pairs = neighbour_pairs(rest)
    return Geometry(
        ids=tuple(ids),
        rest=rest,
        rooted=tuple(k for k, row in enumerate(rows) if formation.weights[row].get(0) == 1.0),
        pairs=pairs,
        gaps=pair_distances(rest, pairs),
        area=area_of(rest),
    )


def neighbour_pairs(points: Vec) -> tuple[tuple[int, int], ...]:
    """Finds neighbours in a plane shape: pairs with no third point in the circle between them.

    This is the Gabriel graph, with points on the circle counted as inside: the sides of a triangle or of the
    rhombus, consecutive drones of a line, rows and columns of a grid.

    Args:
        points: (n, 2) m.

    Returns:
        Pairs of rows, the smaller first.
    """
    squared = np.sum((points[:, None] - points[None]) ** 2, axis=2)
    # k is in the circle over i and j as its diameter exactly if |ik|^2 + |jk|^2 <= |ij|^2.
    through = squared[:, None, :] + squared[None, :, :]
    inside = through <= squared[:, :, None] * (1.0 + _ON_CIRCLE)
    rows = np.arange(len(points))
    inside[rows, :, rows] = inside[:, rows, rows] = False
    linked = np.triu(~inside.any(axis=2), k=1)
    return tuple((int(i), int(j)) for i, j in np.argwhere(linked))


def pair_distances(points: Vec, pairs: Sequence[tuple[int, int]]) -> Vec:
    """Returns the distances (p,) between pairs of (n, 2) points, m."""
    first, second = _columns(pairs)
    distances: Vec = np.linalg.norm(points[first] - points[second], axis=1)
    return distances


def pair_rates(points: Vec, velocities: Vec, pairs: Sequence[tuple[int, int]]) -> Vec:
    """Returns how fast the distances of pairs of (n, 2) points grow, (p,) m/s."""
    first, second = _columns(pairs)
    way = points[first] - points[second]
    distances = np.linalg.norm(way, axis=1)
    closing = np.sum(way * (velocities[first] - velocities[second]), axis=1)
    rates: Vec = np.divide(closing, distances, out=np.zeros_like(closing), where=distances > 0.0)
    return rates


def area_of(points: Vec) -> float:
    """Returns the area of the convex hull of (n, 2) points, m^2."""
    return hull_area((x, y) for x, y in points.tolist())


def area_ratio(area: float, default: float) -> float:
    """Returns an area over its default; 1 where the default has none."""
    return area / default if default > _NO_AREA else 1.0


def right_of(direction: Vec) -> Vec:
    """Returns the (2,) unit vector to the right of a direction, seen from above."""
    return np.array((direction[1], -direction[0]))


def _columns(pairs: Sequence[tuple[int, int]]) -> tuple[list[int], list[int]]:
    return [i for i, _ in pairs], [j for _, j in pairs]
