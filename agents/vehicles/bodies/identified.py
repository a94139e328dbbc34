"""The body fitted on the recorded flights (DESIGN section 7a).

Per horizontal axis `a = 15.64 e - 8.65 v + 2.75 int(e)`; the vertical axis is that of the `crazyflie` body.
"""

import math
from typing import Final, final

from agents.control.vectors import Vector, clip
from agents.vehicles.bodies.airframe import DRAG, MOTOR_LAG, move, thrust_of
from agents.vehicles.bodies.pid import LIFT, PERIOD, ROUNDING, open_loop
from agents.vehicles.bodies.state import FLY, Body, Model

STIFFNESS: Final = 15.64
DAMPING: Final = 8.65
INTEGRAL_GAIN: Final = 2.75

INTEGRAL_LIMIT: Final = 1.0
"""Bound of `int(e)`, m s. Recorded flights reach 0.96: a bound of 0.5 would put one of them 56 mm off."""

ACCELERATION_LIMIT: Final = 5.0
"""m/s^2."""


@final
class Identified(Model):
    """See the module.

    On the ground the integral is 0 and frozen; while the command is not FLY it is frozen and only drag acts
    horizontally.
    """

    def fly(self, body: Body, kind: int, setpoint: Vector, dt: float, substeps: int) -> Body:
        """See `Model.fly`."""
        x, y, z = body.position
        u, v, w = body.velocity
        thrust, wait = body.thrust, body.wait
        a, b, c = body.integral
        ex, ey, ez = body.error
        p, q, pwm = body.output
        wanted_x, wanted_y, wanted_z = setpoint
        flying = kind == FLY
        steady, lag = thrust_of(pwm), math.exp(-dt / MOTOR_LAG)
        for _ in range(substeps):
            grounded = z <= 0.0
            if grounded:
                a = b = 0.0
            if flying:
                dx, dy = wanted_x - x, wanted_y - y
                if not grounded:
                    a = clip(a + dx * dt, -INTEGRAL_LIMIT, INTEGRAL_LIMIT)
                    b = clip(b + dy * dt, -INTEGRAL_LIMIT, INTEGRAL_LIMIT)
                along_x = _acceleration(dx, u, a)
                along_y = _acceleration(dy, v, b)
            else:
                along_x, along_y = -DRAG * u, -DRAG * v
            if wait <= ROUNDING:
                still = open_loop(kind, pwm, grounded=grounded)
                c, ez, pwm = LIFT.tick(wanted_z - z, c, ez, still, flying=flying, grounded=grounded)
                steady = thrust_of(pwm)
                wait += PERIOD
            wait -= dt
            later = steady + (thrust - steady) * lag
            x, y, z, u, v, w = move((x, y, z, u, v, w), along_x, along_y, 0.5 * (thrust + later), dt)
            thrust = later
        error, output = (ex, ey, ez), (p, q, pwm)
        return Body((x, y, z), (u, v, w), (a, b, c), error, output, body.tilt, body.tilt_rate, thrust, wait)


def _acceleration(error: float, velocity: float, integral: float) -> float:
    wanted = STIFFNESS * error - DAMPING * velocity + INTEGRAL_GAIN * integral
    return clip(wanted, -ACCELERATION_LIMIT, ACCELERATION_LIMIT)
