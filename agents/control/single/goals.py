"""The goal of one drone: its row of the formation's matrix (Eqs. 11-13), see `agents.control.goals`."""

import math
from collections.abc import Sequence

from attrs import frozen

from agents.control.hand import MappedHand
from agents.control.single.impedance import LinkState
from agents.control.single.vectors import Vector, clamp, rotate, vector
from shared.formation import Formation, Link
from shared.messages import MAX_POSITION, MAX_VELOCITY

_FARTHEST: Vector = (MAX_POSITION, MAX_POSITION, MAX_POSITION)
_FASTEST: Vector = (MAX_VELOCITY, MAX_VELOCITY, MAX_VELOCITY)


@frozen(kw_only=True)
class Row:
    """One row of a formation.

    Attributes:
        weights: Reference weights over `[human, references]`.
        offset: m, formation frame.
        links: The links into this drone.
        scale: Factor on the correction.
    """

    weights: tuple[float, ...]
    offset: Vector
    links: tuple[Link, ...]
    scale: float


def drone_row(formation: Formation, drone: int) -> Row:
    """Returns the row of one drone; its weights are for `[human, formation.references(drone)...]`."""
    row = formation.row(drone)
    columns = [0, *(1 + formation.row(other) for other in formation.references(drone))]
    return Row(
        weights=tuple(formation.weights[row][columns].tolist()),
        offset=vector(formation.offsets[row]),
        links=formation.links_into(drone),
        scale=formation.correction_scale,
    )


def correction(row: Row, states: Sequence[LinkState]) -> tuple[Vector, Vector]:
    """Returns the correction, m, and its rate, m/s, in the formation's frame.

    `(-|sum dx|, sum dy, sum dz)` over the links; each term is clamped per axis, and a clamped term has no rate.
    """
    x = y = z = u = v = w = 0.0
    for link, ((dx, dy, dz), (rx, ry, rz)) in zip(row.links, states, strict=True):
        limit = link.limit
        if -limit <= dx <= limit:
            x, u = x + dx, u + rx
        else:
            x += math.copysign(limit, dx)
        if -limit <= dy <= limit:
            y, v = y + dy, v + ry
        else:
            y += math.copysign(limit, dy)
        if -limit <= dz <= limit:
            z, w = z + dz, w + rz
        else:
            z += math.copysign(limit, dz)
    k = row.scale
    retreat = -u if x > 0.0 else u if x < 0.0 else 0.0
    return (-k * abs(x), k * y, k * z), (k * retreat, k * v, k * w)


def weighted(row: Row, vectors: Sequence[Vector]) -> Vector:
    """Returns the weighted sum over `[human, references]` of their points or velocities."""
    x = y = z = 0.0
    for weight, (a, b, c) in zip(row.weights, vectors, strict=True):
        x, y, z = x + weight * a, y + weight * b, z + weight * c
    return (x, y, z)


def goal_of(
    row: Row,
    links: Sequence[LinkState],
    hand: MappedHand,
    points: Sequence[Vector],
    velocities: Sequence[Vector],
    heights: Sequence[float] | None,
) -> tuple[Vector, Vector]:
    """Returns goal and goal velocity of one row: Eqs. 11-13, or the same on the references' goals.

    Args:
        row: The row.
        links: State of its links.
        hand: The mapped hand.
        points: Of its references, m.
        velocities: Their goal velocities, m/s.
        heights: Rest heights of the references above the hand, m; None uses those of their points.
    """
    if heights is not None:
        points = [(x, y, hand.point[2] + height) for (x, y, _), height in zip(points, heights, strict=True)]
    own, rate = correction(row, links)
    x, y, z = weighted(row, [hand.point, *points])
    u, v, w = weighted(row, [hand.velocity, *velocities])
    a, b, c = place(row, own, hand.yaw)
    d, e, f = place_velocity(row, own, rate, hand.yaw, hand.yaw_rate)
    # A goal that no receiver would accept, because a reference is at the edge of the range, helps nobody.
    return _within((x + a, y + b, z + c), _FARTHEST), _within((u + d, v + e, w + f), _FASTEST)


def _within(vector: Vector, largest: Vector) -> Vector:
    x, y, z = largest
    return clamp(vector, (-x, -y, -z), largest)


def place(row: Row, correction: Vector, yaw: float) -> Vector:
    """Returns where the goal is from its references, world frame, m: `R(yaw) (offset + correction)`."""
    (x, y, z), (a, b, c) = row.offset, correction
    return rotate((x + a, y + b, z + c), yaw)


def place_velocity(row: Row, correction: Vector, rate: Vector, yaw: float, yaw_rate: float) -> Vector:
    """Returns how fast `place` changes, world frame, m/s.

    Args:
        row: Of this drone.
        correction: Formation frame, m.
        rate: Its rate, formation frame, m/s.
        yaw: Heading of the formation, rad.
        yaw_rate: rad/s.
    """
    (x, y, _), (a, b, _), (u, v, w) = row.offset, correction, rate
    return rotate((u - yaw_rate * (y + b), v + yaw_rate * (x + a), w), yaw)
