"""Vectors in the world or the formation's frame as tuples of floats."""

import math

from shared.messages import ORIGIN, Vector

__all__ = ["ORIGIN", "Planar", "Vector", "clamp", "distance", "norm", "rotate", "shorten"]

Planar = tuple[float, float]
"""Horizontal part of a vector."""


def norm(vector: Vector) -> float:
    """Returns the length."""
    x, y, z = vector
    return math.sqrt(x * x + y * y + z * z)


def distance(one: Vector, other: Vector) -> float:
    """Returns how far two points are apart."""
    x, y, z = one
    a, b, c = other
    return norm((a - x, b - y, c - z))


def shorten(vector: Vector, largest: float) -> Vector:
    """Shortens a vector to at most `largest`."""
    length = norm(vector)
    if length <= largest:
        return vector
    x, y, z = vector
    share = largest / length
    return (x * share, y * share, z * share)


def clip(value: float, low: float, high: float) -> float:
    """Returns the nearest number from `low` to `high`."""
    return low if value < low else high if value > high else value


def clamp(vector: Vector, low: Vector, high: Vector) -> Vector:
    """Returns the nearest point of the box from `low` to `high`."""
    x, y, z = vector
    x0, y0, z0 = low
    x1, y1, z1 = high
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
