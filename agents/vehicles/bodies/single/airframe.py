"""Motors, motion and ground of one body, see `agents.vehicles.bodies.airframe`."""

import math

from agents.vehicles.bodies.airframe import DRAG, GRAVITY, MASS, MOTOR_LAG, thrust_of
from agents.vehicles.bodies.single.state import Planar
from shared.messages import ORIGIN, Vector


def move(
    position: Vector, velocity: Vector, thrust: float, pwm: float, horizontal: Planar, dt: float
) -> tuple[Vector, Vector, float]:
    """Integrates thrust, velocity and position over one substep; the ground stops whatever reaches it.

    Args:
        position: World frame, m.
        velocity: World frame, m/s.
        thrust: N.
        pwm: Motor command of this substep.
        horizontal: Mean acceleration over the substep, m/s^2.
        dt: Substep, s.

    Returns:
        Position, velocity and thrust `dt` later.
    """
    (x, y, z), (u, v, w), (a, b) = position, velocity, horizontal
    target = thrust_of(pwm)
    later = target + (thrust - target) * math.exp(-dt / MOTOR_LAG)
    c = (thrust + later) / (2.0 * MASS) - GRAVITY - DRAG * w
    u1, v1, w1 = u + a * dt, v + b * dt, w + c * dt
    half = 0.5 * dt
    height = z + (w + w1) * half
    if height <= 0.0:
        return (x, y, 0.0), ORIGIN, later
    return (x + (u + u1) * half, y + (v + v1) * half, height), (u1, v1, w1), later
