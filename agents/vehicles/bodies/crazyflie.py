"""A Crazyflie 2.0 (Foerster 2015, reduced) under the PID that the paper quotes (DESIGN section 7b).

Horizontally `a = g tan(tilt)`, with the tilt following its command as a second-order system.
"""

import math
from typing import Final, final

from agents.control.vectors import Planar, Vector
from agents.vehicles.bodies.airframe import DRAG, GRAVITY, MOTOR_LAG, move, thrust_of
from agents.vehicles.bodies.pid import LIFT, PERIOD, ROUNDING, TILT, open_loop
from agents.vehicles.bodies.state import FLY, Body, Model

ATTITUDE_BANDWIDTH: Final = 12.0
"""Natural frequency of the critically damped attitude, rad/s."""


@final
class Crazyflie(Model):
    """See the module."""

    def fly(self, body: Body, kind: int, setpoint: Vector, dt: float, substeps: int) -> Body:
        """See `Model.fly`."""
        x, y, z = body.position
        u, v, w = body.velocity
        thrust, wait = body.thrust, body.wait
        a, b, c = body.integral
        ex, ey, ez = body.error
        pitch, roll, pwm = body.output
        p, q = body.tilt
        p_rate, q_rate = body.tilt_rate
        sx, sy, sz = setpoint
        flying = kind == FLY
        steady, lag = thrust_of(pwm), math.exp(-dt / MOTOR_LAG)
        decay = math.exp(-ATTITUDE_BANDWIDTH * dt)
        for _ in range(substeps):
            grounded = z <= 0.0
            if wait <= ROUNDING:
                still = open_loop(kind, pwm, grounded=grounded)
                a, ex, pitch = TILT.tick(sx - x, a, ex, 0.0, flying=flying, grounded=grounded)
                b, ey, roll = TILT.tick(sy - y, b, ey, 0.0, flying=flying, grounded=grounded)
                c, ez, pwm = LIFT.tick(sz - z, c, ez, still, flying=flying, grounded=grounded)
                steady = thrust_of(pwm)
                wait += PERIOD
            wait -= dt
            p1, p_rate = _follow(p, p_rate, 0.0 if grounded else math.radians(pitch), dt, decay)
            q1, q_rate = _follow(q, q_rate, 0.0 if grounded else math.radians(roll), dt, decay)
            along_x = GRAVITY * math.tan(0.5 * (p + p1)) - DRAG * u
            along_y = GRAVITY * math.tan(0.5 * (q + q1)) - DRAG * v
            later = steady + (thrust - steady) * lag
            x, y, z, u, v, w = move((x, y, z, u, v, w), along_x, along_y, 0.5 * (thrust + later), dt)
            p, q, thrust = p1, q1, later
        error, output, tilt, tilt_rate = (ex, ey, ez), (pitch, roll, pwm), (p, q), (p_rate, q_rate)
        return Body((x, y, z), (u, v, w), (a, b, c), error, output, tilt, tilt_rate, thrust, wait)


def _follow(tilt: float, rate: float, command: float, dt: float, decay: float) -> Planar:
    """Returns tilt and its rate after an exact step of `x'' + 2 w x' + w^2 x = w^2 u` with u held."""
    offset = tilt - command
    slope = rate + ATTITUDE_BANDWIDTH * offset
    return (command + (offset + slope * dt) * decay, (rate - ATTITUDE_BANDWIDTH * slope * dt) * decay)
