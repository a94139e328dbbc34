"""The body fitted on the recorded flights (DESIGN section 7a).

Per horizontal axis `a = 15.64 e - 8.65 v + 2.75 int(e)`; the vertical axis is that of the `crazyflie` body.
"""

import numpy as np

from agents.vehicles.bodies.airframe import DRAG, move
from agents.vehicles.bodies.pid import VERTICAL, clip, control
from agents.vehicles.bodies.state import BodyState, Commands

STIFFNESS = 15.64
DAMPING = 8.65
INTEGRAL_GAIN = 2.75

INTEGRAL_LIMIT = 1.0
"""Bound of `int(e)`, m s. Recorded flights reach 0.96: a bound of 0.5 would put one of them 56 mm off."""

ACCELERATION_LIMIT = 5.0
"""m/s^2."""


def step(state: BodyState, commands: Commands, dt: float) -> BodyState:
    """Advances N identified bodies by one substep.

    Args:
        state: N bodies.
        commands: One per body.
        dt: Substep, s, at most the controller's 0.02.

    Returns:
        The bodies `dt` later. On the ground the integral is 0 and frozen; while the command is not FLY it is
        frozen and only drag acts horizontally.
    """
    flying = commands.flying
    velocity = state.velocity[:, :2]
    error = commands.setpoint[:, :2] - state.position[:, :2]
    integral = state.integral.copy()
    integral[:, :2] = clip(state.integral[:, :2] + error * dt * flying, -INTEGRAL_LIMIT, INTEGRAL_LIMIT)
    integral[state.grounded, :2] = 0.0
    wanted = STIFFNESS * error - DAMPING * velocity + INTEGRAL_GAIN * integral[:, :2]
    acceleration = np.where(flying, clip(wanted, -ACCELERATION_LIMIT, ACCELERATION_LIMIT), -DRAG * velocity)
    return move(control(state._replace(integral=integral), commands, VERTICAL, dt), acceleration, dt)
