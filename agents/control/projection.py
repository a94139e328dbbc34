"""Keeps set-points out of columns by moving them radially: the rule of the recorded flights.

`project_exact` is that rule, reproduced to the digits of the recordings. It jumps from one side of a column
to the other as a goal passes its centre, up to 0.64 m in one tick, so it is for replay only; `project_swept`
is the rule that a vehicle may fly. Planar: columns are vertical and of unlimited height.
"""

import math
from typing import Final

from agents.control.vectors import Planar

SWEPT_MARGIN: Final = 0.06
"""Clearance of a swept set-point beyond the flights' circle, m: room for the vehicle's tracking error."""

TOLERANCE: Final = 1e-9
"""Depth inside a circle that counts as on it, m."""

CENTRE: Final = 1e-12
"""A point this near to a centre is on it: it has no radial direction, m."""


def project_exact(point: Planar, columns: tuple[Planar, ...], radius: float) -> Planar:
    """Moves a point radially out of every circle that it is in, one circle after the other, in order.

    The order matters: leaving one circle may enter the next, and an earlier one is not looked at again.

    Args:
        point: Wanted set-point, m.
        columns: Centres, m.
        radius: Radius of the circles, m.

    Returns:
        m. A point exactly on a centre has no radial direction and leaves towards +x.
    """
    x, y = point
    for cx, cy in columns:
        dx, dy = x - cx, y - cy
        distance = math.sqrt(dx * dx + dy * dy)
        if distance >= radius:
            continue
        if distance > CENTRE:
            x, y = cx + radius * (dx / distance), cy + radius * (dy / distance)
        else:
            x, y = cx + radius, cy
    return (x, y)


def project_swept(
    previous: Planar,
    target: Planar,
    columns: tuple[Planar, ...],
    radius: float,
    longest: float,
    margin: float = SWEPT_MARGIN,
) -> Planar:
    """Moves a set-point towards its projected target without ever crossing a column.

    The target is projected out of the circles of `radius + margin` like in `project_exact`. The way there is
    straight; where it would enter a circle only its tangential part is kept, so the set-point slides around
    the column, or waits where sliding does not bring it nearer. A set-point that starts inside a circle first
    leaves it radially.

    Args:
        previous: Set-point of the previous tick, m.
        target: Wanted set-point, m.
        columns: Centres, m.
        radius: Radius of the flights' circle, m.
        longest: Longest move in this tick, m.
        margin: Added to the radius, m.

    Returns:
        m: at most `longest` from `previous`, and the move comes no nearer to any centre than the
        smaller of `radius + margin` and the distance it starts at.
    """
    x, y = previous
    clearance = radius + margin
    # The tolerance keeps a set-point that slides on a circle from counting as inside it by rounding.
    outside = project_exact(previous, columns, clearance - TOLERANCE)
    trapped = outside != previous
    a, b = outside if trapped else project_exact(target, columns, clearance)
    move = _shorten((a - x, b - y), longest)
    for centre in columns:
        if _enters(previous, move, centre, clearance):
            move = _tangential(previous, move, centre)
    for centre in columns:
        # Sliding past one column may have turned the move into another: then it waits.
        if _enters(previous, move, centre, clearance):
            return previous
    # All the way: at the target itself, not at what rounding makes of the way there.
    return (a, b) if move == (a - x, b - y) else (x + move[0], y + move[1])


def _shorten(move: Planar, longest: float) -> Planar:
    u, v = move
    length = math.sqrt(u * u + v * v)
    if length <= longest:
        return move
    share = longest / length
    return (u * share, v * share)


def _tangential(start: Planar, move: Planar, centre: Planar) -> Planar:
    """Removes the part of the move that points towards the centre."""
    dx, dy = start[0] - centre[0], start[1] - centre[1]
    distance = math.sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return move
    hx, hy = dx / distance, dy / distance
    u, v = move
    inwards = min(0.0, u * hx + v * hy)
    return (u - inwards * hx, v - inwards * hy)


def _enters(start: Planar, move: Planar, centre: Planar, clearance: float) -> bool:
    """Says whether a move comes nearer to the centre than `clearance` and than where it starts."""
    dx, dy = centre[0] - start[0], centre[1] - start[1]
    u, v = move
    squared = u * u + v * v
    along = (dx * u + dy * v) / squared if squared > 0.0 else 0.0
    share = min(max(along, 0.0), 1.0)
    nx, ny = dx - share * u, dy - share * v
    allowed = min(clearance, math.sqrt(dx * dx + dy * dy)) - TOLERANCE
    return math.sqrt(nx * nx + ny * ny) < allowed
