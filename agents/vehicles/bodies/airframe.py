"""Motors, motion and ground, shared by all bodies: the Crazyflie 2.0 of Foerster (2015), reduced.

The reduced model is a point mass whose thrust acts along z, whatever the tilt; it stays within 16 mm of the
six-degree-of-freedom one for steps up to 1 m (DESIGN section 7b).
"""

import math
from typing import TypeVar

import numpy as np

from agents.vehicles.bodies.state import BodyState, Vec

GRAVITY = 9.81
MASS = 0.028
"""kg (Foerster 2015)."""

HOVER_PWM = 37_287.0
"""Motor command whose thrust carries the weight."""

MOTOR_LAG = 0.065
"""Time constant of the thrust, s."""

DRAG = 0.05
"""Effective linear drag, 1/s: brings the x step's overshoot from 18.7 % to the 17 % of the full model."""


Number = TypeVar("Number", float, Vec)


def thrust_of(pwm: Number) -> Number:
    """Static thrust of the four rotors (Foerster 2015).

    Args:
        pwm: Motor command 0..65535, of one body or (N,); 0 is motors off.

    Returns:
        N, shaped alike.
    """
    rotors = 4.0 * ((2.130295e-11 * pwm + 1.032633e-6) * pwm + 5.484560e-4)
    return rotors * (pwm > 0.0)


def move(state: BodyState, horizontal: Vec, dt: float) -> BodyState:
    """Integrates thrust, velocity and position over one substep; the ground stops whatever reaches it.

    Args:
        state: N bodies with the controller output of this substep.
        horizontal: (N, 2) mean acceleration over the substep, m/s^2.
        dt: Substep, s.

    Returns:
        The bodies `dt` later. One on the ground stays where it stands until its thrust exceeds its weight.
    """
    target = thrust_of(state.output[:, 2])
    thrust = target + (state.thrust - target) * math.exp(-dt / MOTOR_LAG)
    acceleration = np.empty_like(state.velocity)
    acceleration[:, :2] = horizontal
    acceleration[:, 2] = (state.thrust + thrust) / (2.0 * MASS) - GRAVITY - DRAG * state.velocity[:, 2]
    velocity = state.velocity + acceleration * dt
    position = state.position + (state.velocity + velocity) * (0.5 * dt)
    down = position[:, 2] <= 0.0
    if down.any():
        position[down, :2] = state.position[down, :2]
        position[down, 2] = 0.0
        velocity[down] = 0.0
    return state._replace(position=position, velocity=velocity, thrust=thrust)
