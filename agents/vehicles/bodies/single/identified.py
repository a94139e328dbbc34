"""One body fitted on the recorded flights, see `agents.vehicles.bodies.identified`."""

import math

from agents.vehicles.bodies.airframe import DRAG, GRAVITY, MASS, MOTOR_LAG, thrust_of
from agents.vehicles.bodies.identified import (
    ACCELERATION_LIMIT,
    DAMPING,
    INTEGRAL_GAIN,
    INTEGRAL_LIMIT,
    STIFFNESS,
)
from agents.vehicles.bodies.pid import PERIOD, ROUNDING
from agents.vehicles.bodies.single.pid import X, Y, Z, control, open_loop
from agents.vehicles.bodies.single.state import FLY, Body
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
    (x, y, z), (u, v, w), thrust, wait = body.position, body.velocity, body.thrust, body.wait
    (a, b, c), (ex, ey, ez), pwm = body.integral, body.error, body.output[Z]
    wanted_x, wanted_y, wanted_z = setpoint
    flying = kind == FLY
    half, steady, lag = 0.5 * dt, thrust_of(pwm), math.exp(-dt / MOTOR_LAG)
    for _ in range(substeps):
        grounded = z <= 0.0
        if grounded:
            a = b = 0.0
        if flying:
            dx, dy = wanted_x - x, wanted_y - y
            if not grounded:
                a, b = a + dx * dt, b + dy * dt
                if abs(a) > INTEGRAL_LIMIT:
                    a = math.copysign(INTEGRAL_LIMIT, a)
                if abs(b) > INTEGRAL_LIMIT:
                    b = math.copysign(INTEGRAL_LIMIT, b)
            along_x = STIFFNESS * dx - DAMPING * u + INTEGRAL_GAIN * a
            along_y = STIFFNESS * dy - DAMPING * v + INTEGRAL_GAIN * b
            if abs(along_x) > ACCELERATION_LIMIT:
                along_x = math.copysign(ACCELERATION_LIMIT, along_x)
            if abs(along_y) > ACCELERATION_LIMIT:
                along_y = math.copysign(ACCELERATION_LIMIT, along_y)
        else:
            along_x, along_y = -DRAG * u, -DRAG * v
        if wait <= ROUNDING:
            pwm = open_loop(kind, pwm, grounded=grounded)
            c, ez, pwm = control(Z, wanted_z - z, c, ez, pwm, flying=flying, grounded=grounded)
            steady = thrust_of(pwm)
            wait += PERIOD
        wait -= dt
        later = steady + (thrust - steady) * lag
        # As `move` in single/airframe.py does it: calling that takes 1.5 % of all the time of a small swarm.
        u1, v1 = u + along_x * dt, v + along_y * dt
        w1 = w + (0.5 * (thrust + later) / MASS - GRAVITY - DRAG * w) * dt
        height = z + (w + w1) * half
        if height <= 0.0:
            z = u = v = w = 0.0
        else:
            x, y, z, u, v, w = x + (u + u1) * half, y + (v + v1) * half, height, u1, v1, w1
        thrust = later
    error, output = (ex, ey, ez), (body.output[X], body.output[Y], pwm)
    return Body((x, y, z), (u, v, w), (a, b, c), error, output, body.tilt, body.tilt_rate, thrust, wait)
