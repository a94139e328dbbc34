"""Plane geometry of the formation."""

from collections.abc import Iterable

Point = tuple[float, float]


def hull_area(points: Iterable[Point]) -> float:
    """Area of the convex hull.

    Args:
        points: Horizontal positions (x, y), m, in any order.

    Returns:
        Area in m^2; 0 for fewer than three points or when all lie on one line.
    """
    corners = hull(points)
    following = corners[1:] + corners[:1]
    return 0.5 * abs(sum(x * v - u * y for (x, y), (u, v) in zip(corners, following, strict=True)))


def hull(points: Iterable[Point]) -> list[Point]:
    """Returns the corners of the convex hull in order (monotone chain); of points on a line, its ends."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered
    return _chain(ordered) + _chain(ordered[::-1])


def _chain(ordered: list[Point]) -> list[Point]:
    """Half of the hull, without its last point, which starts the other half."""
    chain: list[Point] = []
    for point in ordered:
        while len(chain) >= 2 and _turn(chain[-2], chain[-1], point) <= 0.0:
            chain.pop()
        chain.append(point)
    return chain[:-1]


def _turn(a: Point, b: Point, c: Point) -> float:
    """Positive when a -> b -> c turns left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
