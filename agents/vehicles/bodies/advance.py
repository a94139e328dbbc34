"""Runs bodies over any duration in substeps."""

import math
from collections.abc import Callable

from agents.vehicles.bodies import crazyflie, identified
from agents.vehicles.bodies.single import crazyflie as one_crazyflie
from agents.vehicles.bodies.single import identified as one_identified
from agents.vehicles.bodies.single.state import Body, Fly, apart, together
from agents.vehicles.bodies.state import BodyState, Commands
from shared.messages import Vector

Step = Callable[[BodyState, Commands, float], BodyState]

SUBSTEP = 0.004
"""Longest substep, s (250 Hz)."""

FEW = 16
"""Up to as many bodies are faster one by one in plain floats, more are faster in arrays."""

BODIES: dict[str, Step] = {"identified": identified.step, "crazyflie": crazyflie.step}
"""Body type of a scenario (`vehicles.*.body`) -> its step."""

ONE_BY_ONE: dict[Step, Fly] = {
    identified.step: one_identified.fly,
    crazyflie.step: one_crazyflie.fly,
}
"""The same for one body in plain floats."""


def advance(step: Step, state: BodyState, commands: Commands, duration: float) -> BodyState:
    """Advances N bodies of one type with the commands held.

    Args:
        step: One of `BODIES`.
        state: N bodies.
        commands: One per body.
        duration: s, >= 0; cut into equal substeps of at most `SUBSTEP`.
    """
    if len(state.thrust) <= FEW:
        fly = ONE_BY_ONE[step]
        orders = zip(apart(state), commands.kind.tolist(), commands.setpoint.tolist(), strict=True)
        return together([advance_one(fly, body, kind, setpoint, duration) for body, kind, setpoint in orders])
    substeps = substeps_of(duration)
    for _ in range(substeps):
        state = step(state, commands, duration / substeps)
    return state


def advance_one(fly: Fly, body: Body, kind: int, setpoint: Vector, duration: float) -> Body:
    """Advances one body with its command held.

    Args:
        fly: One of `ONE_BY_ONE`.
        body: Before.
        kind: Value of a `Command`.
        setpoint: m.
        duration: As for `advance`.
    """
    substeps = substeps_of(duration)
    return fly(body, kind, setpoint, duration / max(substeps, 1), substeps)


def substeps_of(duration: float) -> int:
    """Returns into how many substeps a duration, s, is cut."""
    # The tolerance keeps 0.012 s, which is not three times 0.004 in floating point, at three substeps.
    return math.ceil(duration / SUBSTEP - 1e-9)
