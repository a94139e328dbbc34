"""Vectors in the world or the formation's frame as tuples of floats."""

import math
from collections.abc import Iterable

from shared.messages import ORIGIN, Vector

__all__ = ["ORIGIN", "Planar", "Vector", "clamp", "norm", "rotate", "shorten", "vector"]

Planar = tuple[float, float]
"""Horizontal part of a vector."""


def vector(numbers: Iterable[float]) -> Vector:
    """Makes a vector of any three numbers, such as a row of an array."""
    x, y, z = map(float, numbers)
    return (x, y, z)


def norm(vector: Vector) -> float:
    """Returns the length."""
    x, y, z = vector
    return math.hypot(x, y, z)


def shorten(vector: Vector, largest: float) -> Vector:
    """Shortens a vector to at most `largest`."""
    x, y, z = vector
    length = math.hypot(x, y, z)
    if length <= largest:
        return vector
    share = largest / length
    return (x * share, y * share, z * share)


def clamp(vector: Vector, low: Vector, high: Vector) -> Vector:
    """Returns the nearest point of the box from `low` to `high`."""
    x, y, z = vector
    (x0, y0, z0), (x1, y1, z1) = low, high
    return (
        x0 if x < x0 else x1 if x > x1 else x,
        y0 if y < y0 else y1 if y > y1 else y,
        z0 if z < z0 else z1 if z > z1 else z,
    )


def rotate(vector: Vector, yaw: float) -> Vector:
    """Turns a vector about z by `yaw`, rad."""
    if yaw == 0.0:
        return vector
    c, s = math.cos(yaw), math.sin(yaw)
    x, y, z = vector
    return (c * x - s * y, s * x + c * y, z)
