"""Avoidance as velocities of the reference point, planar (DESIGN section 4).

Columns: potential field, Eqs. 14-16, `U = xi/2 |p - goal|^2 + sum eta/2 (1/rho - 1/d0)^2` with rho the distance
to the surface. Every other drone and the hand: the same repulsion. These fields are part of the mission, as the
paper has them; that nobody is ever touched is the safety filter's task.
"""

import math
from dataclasses import dataclass
from typing import Final, final

from agents.control.safety.encounter import COINCIDENT, Encounter
from agents.control.vectors import Planar

FLOOR: Final = 0.02
"""Smallest rho that is computed with, m."""


@final
@dataclass(frozen=True)
class Field:
    """Potential field of one kind of obstacle (Eqs. 14-16).

    Attributes:
        eta: Gain of the repulsion, m^4/s.
        d0: Distance from the surface at which it starts, m.
        radius: Radius of the obstacle, m.
    """

    eta: float
    d0: float
    radius: float


def repulsion(x: float, y: float, field: Field) -> Planar:
    """Returns the velocity `eta (1/rho - 1/d0) / rho^2` away from an obstacle, m/s, Eq. 16; zero out of range.

    Args:
        x: From the centre of the obstacle to the point, m.
        y: The same.
        field: Gain, range and radius.
    """
    squared, reach = x * x + y * y, field.radius + field.d0
    if squared >= reach * reach:
        return (0.0, 0.0)
    distance = math.sqrt(squared)
    rho = max(distance - field.radius, FLOOR)
    if rho >= field.d0:
        return (0.0, 0.0)
    strength = field.eta * (1.0 / rho - 1.0 / field.d0) / (rho * rho)
    if distance <= COINCIDENT:
        return (strength, 0.0)
    return (strength * (x / distance), strength * (y / distance))


def separation(x: float, y: float, others: list[Encounter], field: Field) -> Planar:
    """Returns the summed repulsion of the encounters from a point (x, y), m/s."""
    u = v = 0.0
    for other in others:
        pu, pv = repulsion(x - other.x, y - other.y, field)
        u, v = u + pu, v + pv
    return (u, v)


def column_velocity(
    point: Planar, goal: Planar, columns: tuple[Planar, ...], field: Field, xi: float
) -> tuple[Planar, bool]:
    """Returns `-grad U`, m/s, and whether any column acts on the point.

    Args:
        point: m.
        goal: m.
        columns: Centres, m.
        field: Of a column.
        xi: Gain of the attraction, 1/s.
    """
    x, y = point
    u = v = 0.0
    near, reach = False, field.radius + field.d0
    for cx, cy in columns:
        dx, dy = x - cx, y - cy
        near = near or dx * dx + dy * dy < reach * reach
        pu, pv = repulsion(dx, dy, field)
        u, v = u + pu, v + pv
    return (xi * (goal[0] - x) + u, xi * (goal[1] - y) + v), near
