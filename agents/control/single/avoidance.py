"""What one drone keeps away from, see `agents.control.avoidance` for the fields and the escapes."""

import math
from collections.abc import Iterable, Sequence

from msgspec import Struct

from agents.control.avoidance import FLOOR, STANDSTILL, Bubble
from agents.control.single.vectors import Planar, Vector
from shared.scenario import FieldSettings

Encounter = tuple[float, float, float, float]
"""Something else: where it is (x, y), m, and how it moves (x, y), m/s."""

COINCIDENT = 1e-9
"""Nearer than this there is no direction away from a centre: a point leaves along +x, m."""


class Threat(Struct, frozen=True):
    """An encounter that demands an escape.

    Attributes:
        heading: Away from the other.
        needed: Speed along the heading that is fast enough, m/s.
        direction: Where to escape to: along the heading and, by `slip`, aside.
    """

    heading: Planar
    needed: float
    direction: Planar


def repulsion(x: float, y: float, settings: FieldSettings) -> Planar:
    """Returns the velocity `eta (1/rho - 1/d0) / rho^2` away from an obstacle, m/s, Eq. 16.

    Args:
        x: From the centre of the obstacle to the point, m.
        y: The same.
        settings: Gain, range and radius.
    """
    squared = x * x + y * y
    if squared >= (settings.radius + settings.d0) ** 2:
        return (0.0, 0.0)
    distance = math.sqrt(squared)
    rho = max(distance - settings.radius, FLOOR)
    if rho >= settings.d0:
        return (0.0, 0.0)
    strength = settings.eta * (1.0 / rho - 1.0 / settings.d0) / (rho * rho)
    if distance <= COINCIDENT:
        return (strength, 0.0)
    return (strength * (x / distance), strength * (y / distance))


def separation(point: Planar | Vector, others: Iterable[Encounter], settings: FieldSettings) -> Planar:
    """Returns the summed repulsion of the encounters, m/s."""
    x, y = point[0], point[1]
    reach = (settings.radius + settings.d0) ** 2
    u = v = 0.0
    for ox, oy, _, _ in others:
        dx, dy = x - ox, y - oy
        if dx * dx + dy * dy < reach:
            pu, pv = repulsion(dx, dy, settings)
            u, v = u + pu, v + pv
    return (u, v)


def column_velocity(
    point: Planar | Vector,
    goal: Planar | Vector,
    columns: Iterable[Planar],
    settings: FieldSettings,
    xi: float,
) -> tuple[Planar, bool]:
    """Returns `-grad U`, m/s, and whether any column acts on the point.

    Args:
        point: m.
        goal: m.
        columns: Centres, m.
        settings: Field of a column.
        xi: Gain of the attraction, 1/s.
    """
    x, y = point[0], point[1]
    u = v = 0.0
    near = False
    for cx, cy in columns:
        near = near or math.sqrt((x - cx) ** 2 + (y - cy) ** 2) < settings.radius + settings.d0
        pu, pv = repulsion(x - cx, y - cy, settings)
        u, v = u + pu, v + pv
    return (xi * (goal[0] - x) + u, xi * (goal[1] - y) + v), near


def threats(
    point: Planar | Vector, velocity: Planar | Vector, others: Iterable[Encounter], bubble: Bubble
) -> list[Threat]:
    """Returns the encounters whose bubble the point is in; mostly there are none.

    Args:
        point: m.
        velocity: m/s.
        others: What to keep away from.
        bubble: How far.
    """
    x, y, u, v = point[0], point[1], velocity[0], velocity[1]
    radius, lead = bubble.radius, bubble.lead
    found = []
    for ox, oy, ou, ov in others:
        dx, dy = x - ox, y - oy
        du, dv = ou - u, ov - v
        squared = dx * dx + dy * dy
        outside = squared - radius * radius
        # No root is needed to see that it is far enough: 2 distance (distance - radius) is larger than that.
        if outside > 0.0 and 2.0 * lead * (du * dx + dv * dy) < outside:
            continue
        distance = math.sqrt(squared)
        hx, hy = (dx / distance, dy / distance) if distance > COINCIDENT else (1.0, 0.0)
        closing = du * hx + dv * hy
        depth = radius + lead * max(closing, 0.0) - distance
        if depth > 0.0:
            needed = depth / bubble.response + max(ou * hx + ov * hy, 0.0)
            found.append(Threat((hx, hy), needed, _direction(hx, hy, du, dv, closing, bubble.slip)))
    return found


def escape(wanted: Planar, pressing: Iterable[Threat]) -> Planar:
    """Returns the velocity to add to `wanted` so that every threat is evaded fast enough, m/s."""
    u, v = wanted
    eu = ev = 0.0
    for threat in pressing:
        (hx, hy), (dx, dy) = threat.heading, threat.direction
        missing = threat.needed - (u * hx + v * hy)
        if missing > 0.0:
            eu, ev = eu + missing * dx, ev + missing * dy
    return (eu, ev)


def columns_near(
    point: Planar | Vector, velocity: Planar | Vector, columns: Sequence[Planar], bubble: Bubble
) -> list[Encounter]:
    """Returns the columns whose bubbles can matter to a point that moves with a velocity."""
    x, y = point[0], point[1]
    reach = bubble.radius + bubble.lead * math.sqrt(velocity[0] ** 2 + velocity[1] ** 2)
    return [(cx, cy, 0.0, 0.0) for cx, cy in columns if (x - cx) ** 2 + (y - cy) ** 2 < reach * reach]


def _direction(hx: float, hy: float, du: float, dv: float, closing: float, slip: float) -> Planar:
    """Returns the heading and, where something closes in, `slip` across it, off the line of approach."""
    if closing <= STANDSTILL:
        return (hx, hy)
    # To the left if right on the line.
    side = -slip if dv * hx - du * hy > 0.0 else slip
    return (hx - side * hy, hy + side * hx)
