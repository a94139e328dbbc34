"""The nearest acceleration that meets linear demands in the plane: exact, in plain floats.

Incremental two-dimensional optimisation (Seidel 1991; for collision avoidance van den Berg et al., "Reciprocal
n-body collision avoidance", 2011): demands are added one by one, and one that the result so far violates must
hold with equality, which leaves a problem on a line. Where not all can be met, ranks decide: the first rank is
met as far as possible, then the next one within what that leaves. The largest violation is what is made small.
"""

import math
from typing import Final, final

from mypy_extensions import mypyc_attr

from agents.control.vectors import Planar

PARALLEL: Final = 1e-9
"""Sine of the angle below which two lines count as parallel."""
TOLERANCE: Final = 1e-9
"""How far rounding may violate a demand, m/s^2."""
FAR: Final = 1e6
"""Far away compared with any acceleration, m/s^2."""


@mypyc_attr(acyclic=True)
@final
class HalfPlane:
    """A demand `x a + y b >= least` on a point (a, b), with (x, y) of length one."""

    def __init__(self, x: float, y: float, least: float) -> None:
        self.x: Final = x
        self.y: Final = y
        self.least: Final = least

    def lack(self, point: Planar) -> float:
        """Returns by how much a point violates it; negative inside."""
        return self.least - self.x * point[0] - self.y * point[1]


def nearest(wanted: Planar, ranks: list[list[HalfPlane]], limit: float) -> tuple[Planar, bool]:
    """Returns the point nearest to a wanted one that meets what can be met.

    Args:
        wanted: Where to be if nothing is demanded.
        ranks: Demands, the most important rank first.
        limit: Largest length of the point; it is never exceeded.

    Returns:
        The point, and whether all demands are met.
    """
    point, met = _shorten(wanted, limit), True
    held: list[HalfPlane] = []
    for rank in ranks:
        planes = held + rank
        done, point = _nearest_to(wanted, planes, limit, point, len(held))
        if done < len(planes):
            met = False
            point = _least_violation(planes, len(held), done, limit, point)
            # Of all points that violate this rank as little, the one nearest to the wanted one.
            planes = held + _relaxed(rank, point)
            done, nearer = _nearest_to(wanted, planes, limit, _shorten(wanted, limit), 0)
            if done == len(planes):
                point = nearer
        held = planes
    return point, met


def _shorten(point: Planar, limit: float) -> Planar:
    x, y = point
    length = math.sqrt(x * x + y * y)
    if length <= limit:
        return point
    return (x * (limit / length), y * (limit / length))


def _relaxed(rank: list[HalfPlane], point: Planar) -> list[HalfPlane]:
    """Returns the demands of a rank, less what the most violated one lacks at a point."""
    worst = TOLERANCE
    for plane in rank:
        worst = max(worst, plane.lack(point) + TOLERANCE)
    return [HalfPlane(plane.x, plane.y, plane.least - worst) for plane in rank]


def _nearest_to(
    wanted: Planar, planes: list[HalfPlane], limit: float, point: Planar, first: int
) -> tuple[int, Planar]:
    """Adds demands, from the given one on, to a point that is the nearest one under those before.

    Returns:
        How many demands are met, all of them unless no point meets them, and the point.
    """
    for i in range(first, len(planes)):
        plane = planes[i]
        if plane.lack(point) <= TOLERANCE:
            continue
        low, high = _on_edge(planes, i, limit)
        if low > high:
            return i, point
        along = min(max(wanted[1] * plane.x - wanted[0] * plane.y, low), high)
        point = (plane.least * plane.x - along * plane.y, plane.least * plane.y + along * plane.x)
    return len(planes), point


def _on_edge(planes: list[HalfPlane], i: int, limit: float) -> Planar:
    """Returns which part of the edge of demand i those before it allow, in the direction (-y, x).

    It is counted from the edge's point nearest to the origin; nothing is left where low exceeds high.
    """
    plane = planes[i]
    rest = limit * limit - plane.least * plane.least
    if rest < 0.0:
        return (1.0, -1.0)
    high = math.sqrt(rest)
    low = -high
    for j in range(i):
        other = planes[j]
        slope = other.y * plane.x - other.x * plane.y
        missing = other.least - plane.least * (other.x * plane.x + other.y * plane.y)
        if abs(slope) <= PARALLEL:
            if missing > TOLERANCE:
                return (1.0, -1.0)
        elif slope > 0.0:
            low = max(low, missing / slope)
        else:
            high = min(high, missing / slope)
    return (low, high)


def _least_violation(planes: list[HalfPlane], hard: int, failed: int, limit: float, point: Planar) -> Planar:
    """Returns a point whose largest violation of `planes[hard:]` is as small as the hard ones before allow.

    Where demand i is violated most, every other one j demands to be violated no more: a half-plane whose edge
    is the bisector of the two.
    """
    worst = 0.0
    for i in range(failed, len(planes)):
        plane = planes[i]
        if plane.lack(point) <= worst + TOLERANCE:
            continue
        bounds = planes[:hard]
        for j in range(hard, i):
            other = planes[j]
            x, y = other.x - plane.x, other.y - plane.y
            length = math.sqrt(x * x + y * y)
            if length > PARALLEL:
                bounds.append(HalfPlane(x / length, y / length, (other.least - plane.least) / length))
        # As deep inside demand i as that allows: the nearest point to one far along its normal.
        far = (plane.x * FAR, plane.y * FAR)
        done, deepest = _nearest_to(far, bounds, limit, _shorten(far, limit), 0)
        if done == len(bounds):
            point = deepest
        worst = max(worst, plane.lack(point))
    return point
