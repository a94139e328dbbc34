"""Runs bodies over any duration in substeps."""

import math
from collections.abc import Callable

from agents.vehicles.bodies import crazyflie, identified
from agents.vehicles.bodies.state import BodyState, Commands

Step = Callable[[BodyState, Commands, float], BodyState]

SUBSTEP = 0.004
"""Longest substep, s (250 Hz)."""

BODIES: dict[str, Step] = {"identified": identified.step, "crazyflie": crazyflie.step}
"""Body type of a scenario (`vehicles.*.body`) -> its step."""


def advance(step: Step, state: BodyState, commands: Commands, duration: float) -> BodyState:
    """Advances N bodies of one type with the commands held.

    Args:
        step: One of `BODIES`.
        state: N bodies.
        commands: One per body.
        duration: s, >= 0; cut into equal substeps of at most `SUBSTEP`.
    """
    # The tolerance keeps 0.012 s, which is not three times 0.004 in floating point, at three substeps.
    substeps = math.ceil(duration / SUBSTEP - 1e-9)
    for _ in range(substeps):
        state = step(state, commands, duration / substeps)
    return state
