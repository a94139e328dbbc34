"""One body, and the way from the rows of a `BodyState` and back; see `agents.vehicles.bodies.state`."""

from collections.abc import Callable, Sequence

import numpy as np
from msgspec import Struct, structs

from agents.vehicles.bodies.state import BodyState, Command
from shared.messages import Vector

Planar = tuple[float, float]
"""Horizontal part of a vector."""

FLY = Command.FLY.value


class Body(Struct, frozen=True):
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
    *vectors, thrust = state[:-1]
    columns = [map(tuple, array.tolist()) for array in vectors]
    rows = zip(*columns, thrust.tolist(), [state.wait] * len(thrust), strict=True)
    return [Body(*row) for row in rows]


def together(bodies: Sequence[Body]) -> BodyState:
    """Returns the rows of these bodies, whose controllers tick together."""
    *columns, waits = zip(*map(structs.astuple, bodies), strict=True)
    return BodyState._make((*map(np.array, columns), waits[0]))
