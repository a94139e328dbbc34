"""One body, and the way from the rows of a `BodyState` and back; see `agents.vehicles.bodies.state`."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from agents.vehicles.bodies.state import BodyState, Command
from shared.messages import Vector

Planar = tuple[float, float]
"""Horizontal part of a vector."""

FLY = Command.FLY.value


class Body(NamedTuple):
    """One row of a `BodyState`: the same fields in the same order."""

    position: Vector
    velocity: Vector
    integral: Vector
    error: Vector
    output: Vector
    tilt: Planar
    tilt_rate: Planar
    thrust: float
    wait: float


Fly = Callable[[Body, int, Vector, float, int], Body]
"""Advances one body with its command held: body, kind of `Command`, set-point, substep, number of substeps."""


def apart(state: BodyState) -> list[Body]:
    """Returns the bodies, one per row."""
    arrays, wait = state[:-1], state.wait
    *vectors, thrust = arrays
    rows = zip(*(map(tuple, array.tolist()) for array in vectors), thrust.tolist(), strict=True)
    return [Body._make((*numbers, wait)) for numbers in rows]


def together(bodies: Sequence[Body]) -> BodyState:
    """Returns the rows of these bodies, whose controllers tick together."""
    *columns, waits = zip(*bodies, strict=True)
    return BodyState._make((*map(np.array, columns), waits[0]))


def bound(value: float, limit: float) -> float:
    """Returns the nearest number between `-limit` and `limit`."""
    return -limit if value < -limit else limit if value > limit else value
