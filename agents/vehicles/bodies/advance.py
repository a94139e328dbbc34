"""Runs bodies over any duration in substeps."""

import math
from collections.abc import Callable

from agents.vehicles.bodies import crazyflie, identified
from agents.vehicles.bodies.single import crazyflie as one_crazyflie
from agents.vehicles.bodies.single import identified as one_identified
from agents.vehicles.bodies.single.state import OneStep, apart, together
from agents.vehicles.bodies.state import BodyState, Commands

Step = Callable[[BodyState, Commands, float], BodyState]

SUBSTEP = 0.004
"""Longest substep, s (250 Hz)."""

FEW = 16
"""Up to as many bodies are faster one by one in plain floats, more are faster in arrays."""

BODIES: dict[str, Step] = {"identified": identified.step, "crazyflie": crazyflie.step}
"""Body type of a scenario (`vehicles.*.body`) -> its step."""

ONE_BY_ONE: dict[Step, OneStep] = {
    identified.step: one_identified.step,
    crazyflie.step: one_crazyflie.step,
}
"""The same step for one body in plain floats."""


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
    if len(state.thrust) <= FEW:
        return _one_by_one(ONE_BY_ONE[step], state, commands, duration, substeps)
    for _ in range(substeps):
        state = step(state, commands, duration / substeps)
    return state


def _one_by_one(
    step: OneStep, state: BodyState, commands: Commands, duration: float, substeps: int
) -> BodyState:
    bodies = apart(state)
    orders = zip(commands.kind.tolist(), commands.setpoint.tolist(), strict=True)
    for row, (kind, setpoint) in enumerate(orders):
        for _ in range(substeps):
            bodies[row] = step(bodies[row], kind, setpoint, duration / substeps)
    return together(bodies)
