"""One body fitted on the recorded flights, see `agents.vehicles.bodies.identified`."""

import math

from agents.vehicles.bodies.airframe import DRAG, MOTOR_LAG, thrust_of
from agents.vehicles.bodies.identified import (
    ACCELERATION_LIMIT,
    DAMPING,
    INTEGRAL_GAIN,
    INTEGRAL_LIMIT,
    STIFFNESS,
)
from agents.vehicles.bodies.pid import PERIOD, ROUNDING
from agents.vehicles.bodies.single.airframe import move
from agents.vehicles.bodies.single.pid import VERTICAL, control
from agents.vehicles.bodies.single.state import FLY, Body, bound
from shared.messages import Vector


def fly(body: Body, kind: int, setpoint: Vector, dt: float, substeps: int) -> Body:
    """Advances one identified body with its command held.

    Args:
        body: Before.
        kind: Value of a `Command`.
        setpoint: m.
        dt: Substep, s, at most the controller's 0.02.
        substeps: How many.
    """
    position, velocity, integral, error, output, tilt, tilt_rate, thrust, wait = body
    wanted_x, wanted_y, _ = setpoint
    steady, lag = thrust_of(output[2]), math.exp(-dt / MOTOR_LAG)
    for _ in range(substeps):
        (x, y, z), (u, v, _), (a, b, c) = position, velocity, integral
        if z <= 0.0:
            a = b = 0.0
        if kind == FLY:
            ex, ey = wanted_x - x, wanted_y - y
            if z > 0.0:
                a, b = bound(a + ex * dt, INTEGRAL_LIMIT), bound(b + ey * dt, INTEGRAL_LIMIT)
            along_x = bound(STIFFNESS * ex - DAMPING * u + INTEGRAL_GAIN * a, ACCELERATION_LIMIT)
            along_y = bound(STIFFNESS * ey - DAMPING * v + INTEGRAL_GAIN * b, ACCELERATION_LIMIT)
        else:
            along_x, along_y = -DRAG * u, -DRAG * v
        integral = (a, b, c)
        if wait <= ROUNDING:
            integral, error, output = control(position, integral, error, output, kind, setpoint, VERTICAL)
            steady = thrust_of(output[2])
            wait += PERIOD
        wait -= dt
        later = steady + (thrust - steady) * lag
        position, velocity = move(position, velocity, along_x, along_y, 0.5 * (thrust + later), dt)
        thrust = later
    return Body(position, velocity, integral, error, output, tilt, tilt_rate, thrust, wait)
