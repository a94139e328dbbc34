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


OneStep = Callable[[Body, int, Vector, float], Body]
"""Advances one body by one substep: body, kind of `Command`, set-point, substep."""


def apart(state: BodyState) -> list[Body]:
    """Returns the bodies, one per row."""
    arrays, wait = state[:-1], state.wait
    rows = zip(*(array.tolist() for array in arrays), strict=True)
    return [Body._make((*numbers, wait)) for numbers in rows]


def together(bodies: Sequence[Body]) -> BodyState:
    """Returns the rows of these bodies, whose controllers tick together."""
    *columns, waits = zip(*bodies, strict=True)
    return BodyState._make((*map(np.array, columns), waits[0]))


def clip(value: float, low: float, high: float) -> float:
    """Returns the nearest number between `low` and `high`."""
    return low if value < low else high if value > high else value
