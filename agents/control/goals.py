"""The goal of one drone from its references and links: one row of the formation's matrix (Eqs. 11-13)."""

import math
from dataclasses import dataclass
from typing import Final, final

from mypy_extensions import mypyc_attr

from agents.control.hand import MappedHand
from agents.control.impedance import Link, LinkState
from agents.control.vectors import Vector, clamp, norm, rotate
from shared.messages import MAX_POSITION, MAX_VELOCITY, Mode


@mypyc_attr(acyclic=True)
class Guide:
    """What a drone follows in the place of one reference.

    Attributes:
        point: Where it is, or should be, m.
        goal_velocity: m/s.
        mode: Its mode, or that of whoever stands behind it.
    """

    def __init__(self, point: Vector, goal_velocity: Vector, mode: Mode) -> None:
        self.point: Final = point
        self.goal_velocity: Final = goal_velocity
        self.mode: Final = mode


@final
@dataclass(frozen=True)
class Row:
    """One row of a formation.

    Attributes:
        weights: Reference weights over `[human, references]`.
        offset: m, formation frame.
        links: The links into this drone.
        scale: Factor on the correction.
        heights: Rest heights of the references above the hand, m; None uses those of their points.
    """

    weights: tuple[float, ...]
    offset: Vector
    links: tuple[Link, ...]
    scale: float
    heights: tuple[float, ...] | None


def correction(row: Row, states: tuple[LinkState, ...]) -> tuple[Vector, Vector]:
    """Returns the correction, m, and its rate, m/s, in the formation's frame.

    `(-|sum dx|, sum dy, sum dz)` over the links; each term is clamped per axis, its state is not, and a clamped
    term has no rate.
    """
    x = y = z = u = v = w = 0.0
    links = row.links
    for i in range(len(links)):
        limit, state = links[i].limit, states[i]
        dx, dy, dz = state.displacement
        rx, ry, rz = state.rate
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
    row: Row, states: tuple[LinkState, ...], hand: MappedHand, lead: list[Guide]
) -> tuple[Vector, Vector]:
    """Returns goal and goal velocity of one row: Eqs. 11-13, or the same on the references' goals.

    The goal is the weighted mean of the references plus `R(yaw) (offset + correction)`; its velocity is made of
    the hand's, the link rates and the references' goal velocities.

    Args:
        row: The row.
        states: State of its links.
        hand: The mapped hand.
        lead: Its references.
    """
    ox, oy, oz = row.offset
    yaw, turning, heights = hand.yaw, hand.yaw_rate, row.heights
    moved, rate = correction(row, states)
    x, y, z = moved
    u, v, w = rate
    x, y, z = ox + x, oy + y, oz + z
    gx, gy, gz = rotate((x, y, z), yaw)
    gu, gv, gw = rotate((u - turning * y, v + turning * x, w), yaw)
    weights = row.weights
    x, y, z = hand.point
    u, v, w = hand.velocity
    weight = weights[0]
    height = z
    x, y, z, u, v, w = weight * x, weight * y, weight * z, weight * u, weight * v, weight * w
    for i in range(len(lead)):
        weight, guide = weights[i + 1], lead[i]
        a, b, c = guide.point
        d, e, f = guide.goal_velocity
        if heights is not None:
            c = height + heights[i]
        x, y, z = x + weight * a, y + weight * b, z + weight * c
        u, v, w = u + weight * d, v + weight * e, w + weight * f
    # A goal that no receiver would accept, because a reference is at the edge of the range, helps nobody.
    return _within((x + gx, y + gy, z + gz), MAX_POSITION), _within((u + gu, v + gv, w + gw), MAX_VELOCITY)


def _within(vector: Vector, limit: float) -> Vector:
    """Returns the nearest vector whose components are at most `limit`."""
    if norm(vector) <= limit:
        return vector
    return clamp(vector, (-limit, -limit, -limit), (limit, limit, limit))
