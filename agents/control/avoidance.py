"""Avoidance as velocities of the reference point, planar (DESIGN section 4).

Columns: potential field, Eqs. 14-16, `U = xi/2 |p - goal|^2 + sum eta/2 (1/rho - 1/d0)^2` with rho the distance
to the surface. Every other drone and the hand: the same repulsion. All three: `escape`, which looks ahead,
because a body follows its set-point about half a second late.

Encounters are flat lists of pairs, so that one agent and a large batch run the same code.
"""

import numpy as np
import numpy.typing as npt
from attrs import field, frozen

from shared.formation import Vec
from shared.scenario import FieldSettings

FLOOR = 0.02
"""Smallest rho that is computed with, m."""
STANDSTILL = 0.05
"""Below this closing speed there is no line of approach, m/s."""


@frozen(kw_only=True)
class Bubble:
    """Distance that `escape` keeps.

    Attributes:
        radius: From something that does not come closer, m.
        lead: The bubble grows by this time times the closing speed, s.
        slip: Share of the escape that leads aside of what comes closer: without it the one who is right in its
            way is pushed along in front of it, and two that are pushed together cannot get past each other.
        response: Time constant of leaving the bubble, s.
    """

    radius: float
    lead: float
    slip: float = 0.0
    response: float = 0.10


# Radius, lead and slip: the smallest distances over strokes in all directions, free, against a fence and
# against a wall of columns, decided (tests/unit/test_safety.py).
DRONE_BUBBLE = Bubble(radius=0.35, lead=0.5, slip=0.2)
HAND_BUBBLE = Bubble(radius=0.46, lead=0.5, slip=0.7)
COLUMN_BUBBLE = Bubble(radius=0.22, lead=0.45)


@frozen(kw_only=True)
class Encounters:
    """Pairs of one of our n points and something else.

    Attributes:
        row: (k,) which of our points.
        position: (k, 2) where the other is, m.
        velocity: (k, 2) how it moves, m/s.
    """

    row: npt.NDArray[np.intp] = field(eq=False)
    position: Vec = field(eq=False)
    velocity: Vec = field(eq=False)


@frozen(kw_only=True)
class Threats:
    """Encounters that demand an escape.

    Attributes:
        row: (k,) which of our points.
        heading: (k, 2) away from the other.
        needed: (k, 1) speed along the heading that is fast enough, m/s.
        direction: (k, 2) where to escape to: along the heading and, by `slip`, aside.
    """

    row: npt.NDArray[np.intp] = field(eq=False)
    heading: Vec = field(eq=False)
    needed: Vec = field(eq=False)
    direction: Vec = field(eq=False)


NOBODY = Threats(
    row=np.empty(0, dtype=np.intp),
    heading=np.empty((0, 2)),
    needed=np.empty((0, 1)),
    direction=np.empty((0, 2)),
)


def repulsion(gaps: Vec, settings: FieldSettings) -> Vec:
    """Returns the repulsive velocity `eta (1/rho - 1/d0) / rho^2` away from each obstacle, Eq. 16.

    Args:
        gaps: (..., 2) vectors from obstacle centres to the point, m.
        settings: Gain, range and radius.

    Returns:
        (..., 2) m/s; zero beyond `radius + d0`.
    """
    distance = _length(gaps)
    rho = np.maximum(distance - settings.radius, FLOOR)
    near = rho < settings.d0
    if not near.any():
        return np.zeros_like(gaps)
    strength = settings.eta * (1.0 / rho - 1.0 / settings.d0) / (rho * rho)
    return np.where(near, strength, 0.0) * _heading(gaps, distance)


def column_velocity(
    points: Vec, goals: Vec, columns: Vec, settings: FieldSettings, xi: float
) -> tuple[Vec, npt.NDArray[np.bool_]]:
    """Returns `-grad U` (n, 2), m/s, and a mask (n, 1) of the points that any column acts on.

    Args:
        points: (n, 2) m.
        goals: (n, 2) m.
        columns: (c, 2) centres, m.
        settings: Field of a column.
        xi: Gain of the attraction, 1/s.
    """
    gaps = points[:, None, :] - columns
    near = np.any(_length(gaps) < settings.radius + settings.d0, axis=1)
    return xi * (goals - points) + repulsion(gaps, settings).sum(axis=1), near


def separation(points: Vec, others: Encounters, settings: FieldSettings) -> Vec:
    """Returns the summed repulsion (n, 2) of the encounters, m/s."""
    return _sum_rows(others.row, repulsion(points[others.row] - others.position, settings), len(points))


def threats(points: Vec, velocities: Vec, others: Encounters, bubble: Bubble) -> Threats:
    """Returns the encounters whose bubble a point is in; mostly there are none.

    In a bubble the point must move away at `depth / response` plus the other's own speed towards it.

    Args:
        points: (n, 2) m.
        velocities: (n, 2) m/s.
        others: What to keep away from.
        bubble: How far.
    """
    gaps = points[others.row] - others.position
    distance = _length(gaps)
    heading = _heading(gaps, distance)
    relative = others.velocity - velocities[others.row]
    depth = bubble.radius + bubble.lead * np.maximum(_along(relative, heading), 0.0) - distance
    inside = np.flatnonzero(depth > 0.0)
    if not len(inside):
        return NOBODY
    heading, relative = heading[inside], relative[inside]
    approach = np.maximum(_along(others.velocity[inside], heading), 0.0)
    return Threats(
        row=others.row[inside],
        heading=heading,
        needed=depth[inside] / bubble.response + approach,
        direction=heading + _aside(heading, relative, bubble.slip),
    )


def escape(wanted: Vec, pressing: Threats) -> Vec:
    """Returns the velocity (n, 2) to add to `wanted` so that every threat is evaded fast enough, m/s."""
    missing = np.maximum(pressing.needed - _along(wanted[pressing.row], pressing.heading), 0.0)
    return _sum_rows(pressing.row, missing * pressing.direction, len(wanted))


def columns_near(points: Vec, velocities: Vec, columns: Vec, bubble: Bubble) -> Encounters:
    """Returns the columns whose bubbles can matter to points (n, 2) that move with velocities (n, 2)."""
    reach = bubble.radius + bubble.lead * _length(velocities)
    row, column = np.nonzero(_length(points[:, None, :] - columns)[..., 0] < reach)
    return Encounters(row=row, position=columns[column], velocity=np.zeros((len(row), 2)))


def _aside(heading: Vec, closing: Vec, slip: float) -> Vec:
    """Returns `slip` across the heading, away from the line of approach; to the left if right on it."""
    across = np.stack([-heading[:, 1], heading[:, 0]], axis=1)
    side = np.where(_along(closing, across) > 0.0, -slip, slip)
    return np.where(_along(closing, heading) > STANDSTILL, side, 0.0) * across


def _sum_rows(row: npt.NDArray[np.intp], pushes: Vec, n: int) -> Vec:
    if n == 1:
        return np.add.reduce(pushes, axis=0, keepdims=True)
    total = np.empty((n, 2))
    for axis in (0, 1):
        total[:, axis] = np.bincount(row, weights=pushes[:, axis], minlength=n)
    return total


def _along(vectors: Vec, heading: Vec) -> Vec:
    along: Vec = np.vecdot(vectors, heading)
    return along[:, None]


def _length(vectors: Vec) -> Vec:
    lengths: Vec = np.sqrt(np.vecdot(vectors, vectors))
    return lengths[..., None]


def _heading(gaps: Vec, distance: Vec) -> Vec:
    # A point exactly on a centre has no direction of its own; it leaves along +x.
    return np.where(distance > 1e-9, gaps / np.maximum(distance, 1e-9), (1.0, 0.0))
