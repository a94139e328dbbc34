"""A Crazyflie 2.0 (Foerster 2015, reduced) under the PID that the paper quotes (DESIGN section 7b).

Horizontally `a = g tan(tilt)`, with the tilt following its command as a second-order system.
"""

import math

import numpy as np

from agents.vehicles.bodies.airframe import DRAG, GRAVITY, move
from agents.vehicles.bodies.pid import ALL_AXES, control
from agents.vehicles.bodies.state import BodyState, Commands

ATTITUDE_BANDWIDTH = 12.0
"""Natural frequency of the critically damped attitude, rad/s."""


def step(state: BodyState, commands: Commands, dt: float) -> BodyState:
    """Advances N Crazyflies by one substep.

    Args:
        state: N bodies.
        commands: One per body.
        dt: Substep, s, at most the controller's 0.02.

    Returns:
        The bodies `dt` later.
    """
    tilted = _follow_attitude(control(state, commands, ALL_AXES, dt), dt)
    acceleration = GRAVITY * np.tan(0.5 * (state.tilt + tilted.tilt)) - DRAG * state.velocity[:, :2]
    return move(tilted, acceleration, dt)


def _follow_attitude(state: BodyState, dt: float) -> BodyState:
    """Exact step of `x'' + 2 w x' + w^2 x = w^2 u` with u held; level on the ground."""
    w = ATTITUDE_BANDWIDTH
    command = np.radians(state.output[:, :2])
    command[state.grounded] = 0.0
    offset = state.tilt - command
    slope = state.tilt_rate + w * offset
    decay = math.exp(-w * dt)
    tilt = command + (offset + slope * dt) * decay
    tilt_rate = (state.tilt_rate - w * slope * dt) * decay
    return state._replace(tilt=tilt, tilt_rate=tilt_rate)
