"""The goal of one drone: its row of the formation's matrix (Eqs. 11-13), see `agents.control.goals`."""

import math
from collections.abc import Sequence

from attrs import frozen
from msgspec import Struct

from agents.control.hand import MappedHand
from agents.control.single.impedance import LinkState
from agents.control.single.vectors import Vector, clamp, rotate, vector
from shared.formation import Formation, Link
from shared.messages import MAX_POSITION, MAX_VELOCITY, Mode


class Guide(Struct, frozen=True):
    """What a drone follows in the place of one reference.

    Attributes:
        point: Where it is, or should be, m.
        goal_velocity: m/s.
        mode: Its mode, or that of whoever stands behind it.
    """

    point: Vector
    goal_velocity: Vector
    mode: Mode


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
    for i, link in enumerate(row.links):
        (dx, dy, dz), (rx, ry, rz), limit = states[i].displacement, states[i].rate, link.limit
        if abs(dx) <= limit:
            x, u = x + dx, u + rx
        else:
            x += math.copysign(limit, dx)
        if abs(dy) <= limit:
            y, v = y + dy, v + ry
        else:
            y += math.copysign(limit, dy)
        if abs(dz) <= limit:
            z, w = z + dz, w + rz
        else:
            z += math.copysign(limit, dz)
    k = row.scale
    retreat = -u if x > 0.0 else u if x < 0.0 else 0.0
    return (-k * abs(x), k * y, k * z), (k * retreat, k * v, k * w)


def goal_of(
    row: Row,
    links: Sequence[LinkState],
    hand: MappedHand,
    lead: Sequence[Guide],
    heights: Sequence[float] | None,
) -> tuple[Vector, Vector]:
    """Returns goal and goal velocity of one row: Eqs. 11-13, or the same on the references' goals.

    The goal is the weighted mean of the references plus `R(yaw) (offset + correction)`.

    Args:
        row: The row.
        links: State of its links.
        hand: The mapped hand.
        lead: Its references.
        heights: Their rest heights above the hand, m; None uses those of their points.
    """
    (ox, oy, oz), yaw, turning = row.offset, hand.yaw, hand.yaw_rate
    (x, y, z), (u, v, w) = correction(row, links)
    x, y, z = ox + x, oy + y, oz + z
    gx, gy, gz = rotate((x, y, z), yaw)
    gu, gv, gw = rotate((u - turning * y, v + turning * x, w), yaw)
    weight, (x, y, z), (u, v, w) = row.weights[0], hand.point, hand.velocity
    x, y, z, u, v, w = weight * x, weight * y, weight * z, weight * u, weight * v, weight * w
    for i, guide in enumerate(lead):
        weight, (a, b, c), (d, e, f) = row.weights[i + 1], guide.point, guide.goal_velocity
        if heights is not None:
            c = hand.point[2] + heights[i]
        x, y, z = x + weight * a, y + weight * b, z + weight * c
        u, v, w = u + weight * d, v + weight * e, w + weight * f
    # A goal that no receiver would accept, because a reference is at the edge of the range, helps nobody.
    return _within(x + gx, y + gy, z + gz, MAX_POSITION), _within(u + gu, v + gv, w + gw, MAX_VELOCITY)


def _within(x: float, y: float, z: float, limit: float) -> Vector:
    """Returns the nearest vector whose components are at most `limit`."""
    if math.hypot(x, y, z) <= limit:
        return (x, y, z)
    return clamp((x, y, z), (-limit, -limit, -limit), (limit, limit, limit))
