"""Avoidance as velocities of the reference point, planar (DESIGN section 4).

Columns: potential field, Eqs. 14-16, `U = xi/2 |p - goal|^2 + sum eta/2 (1/rho - 1/d0)^2` with rho the distance
to the surface. Every other drone and the hand: the same repulsion. All three: `escape`, which looks ahead,
because a body follows its set-point about half a second late.
"""

import math
from typing import Final, final

from agents.control.vectors import Planar
from shared.cells import Place

FLOOR: Final = 0.02
"""Smallest rho that is computed with, m."""
STANDSTILL: Final = 0.05
"""Below this closing speed there is no line of approach, m/s."""
COINCIDENT: Final = 1e-9
"""Nearer than this there is no direction away from a centre: a point leaves along +x, m."""


@final
class Field:
    """Potential field of one kind of obstacle (Eqs. 14-16).

    Attributes:
        eta: Gain of the repulsion, m^4/s.
        d0: Distance from the surface at which it starts, m.
        radius: Radius of the obstacle, m.
    """

    __slots__ = ("d0", "eta", "radius")

    def __init__(self, eta: float, d0: float, radius: float) -> None:
        self.eta: Final = eta
        self.d0: Final = d0
        self.radius: Final = radius


@final
class Bubble:
    """Distance that `escape` keeps.

    Attributes:
        radius: From something that does not come closer, m.
        lead: The bubble grows by this time times the closing speed, s.
        slip: Share of the escape that leads aside of what comes closer: without it the one who is right in its
            way is pushed along in front of it, and two that are pushed together cannot get past each other.
        response: Time constant of leaving the bubble, s.
    """

    __slots__ = ("lead", "radius", "response", "slip")

    def __init__(self, radius: float, lead: float, slip: float = 0.0, response: float = 0.10) -> None:
        self.radius: Final = radius
        self.lead: Final = lead
        self.slip: Final = slip
        self.response: Final = response


# Radius, lead and slip: the smallest distances over strokes in all directions, free, against a fence and
# against a wall of columns, decided (tests/unit/test_safety.py).
DRONE_BUBBLE: Final = Bubble(radius=0.35, lead=0.5, slip=0.2)
HAND_BUBBLE: Final = Bubble(radius=0.46, lead=0.5, slip=0.7)
COLUMN_BUBBLE: Final = Bubble(radius=0.22, lead=0.45)


@final
class Encounter(Place):
    """Something else: where it is (x, y), m, and how it moves (u, v), m/s."""

    __slots__ = ("u", "v")

    def __init__(self, x: float, y: float, u: float, v: float) -> None:
        super().__init__(x, y)
        self.u: Final = u
        self.v: Final = v


@final
class Threat:
    """An encounter that demands an escape.

    Attributes:
        heading: Away from the other.
        needed: Speed along the heading that is fast enough, m/s.
        direction: Where to escape to: along the heading and, by `slip`, aside.
    """

    __slots__ = ("direction", "heading", "needed")

    def __init__(self, heading: Planar, needed: float, direction: Planar) -> None:
        self.heading: Final = heading
        self.needed: Final = needed
        self.direction: Final = direction


NO_THREATS: Final[list[Threat]] = []


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


def threats(point: Planar, velocity: Planar, others: list[Encounter], bubble: Bubble) -> list[Threat]:
    """Returns the encounters whose bubble the point is in; mostly there are none.

    In a bubble the point must move away at `depth / response` plus the other's own speed towards it.

    Args:
        point: m.
        velocity: m/s.
        others: What to keep away from.
        bubble: How far.
    """
    x, y = point
    u, v = velocity
    radius, lead = bubble.radius, bubble.lead
    found = NO_THREATS
    for other in others:
        dx, dy = x - other.x, y - other.y
        du, dv = other.u - u, other.v - v
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
            needed = depth / bubble.response + max(other.u * hx + other.v * hy, 0.0)
            threat = Threat((hx, hy), needed, _direction(hx, hy, du, dv, closing, bubble.slip))
            found = [*found, threat]
    return found


def escape(wanted: Planar, pressing: list[Threat]) -> Planar:
    """Returns the velocity to add to `wanted` so that every threat is evaded fast enough, m/s."""
    u, v = wanted
    eu = ev = 0.0
    for threat in pressing:
        hx, hy = threat.heading
        dx, dy = threat.direction
        missing = threat.needed - (u * hx + v * hy)
        if missing > 0.0:
            eu, ev = eu + missing * dx, ev + missing * dy
    return (eu, ev)


def columns_near(
    point: Planar, velocity: Planar, columns: tuple[Planar, ...], bubble: Bubble
) -> list[Encounter]:
    """Returns the columns whose bubbles can matter to a point that moves with a velocity."""
    x, y = point
    u, v = velocity
    reach = bubble.radius + bubble.lead * math.sqrt(u * u + v * v)
    near = []
    for cx, cy in columns:
        if (x - cx) * (x - cx) + (y - cy) * (y - cy) < reach * reach:
            near.append(Encounter(cx, cy, 0.0, 0.0))
    return near


def _direction(hx: float, hy: float, du: float, dv: float, closing: float, slip: float) -> Planar:
    """Returns the heading and, where something closes in, `slip` across it, off the line of approach."""
    if closing <= STANDSTILL:
        return (hx, hy)
    # To the left if right on the line.
    side = -slip if dv * hx - du * hy > 0.0 else slip
    return (hx - side * hy, hy + side * hx)
