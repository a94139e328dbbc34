"""One Crazyflie, see `agents.vehicles.bodies.crazyflie`."""

import math

from agents.vehicles.bodies.airframe import DRAG, GRAVITY, MOTOR_LAG, thrust_of
from agents.vehicles.bodies.crazyflie import ATTITUDE_BANDWIDTH
from agents.vehicles.bodies.pid import PERIOD, ROUNDING
from agents.vehicles.bodies.single.airframe import move
from agents.vehicles.bodies.single.pid import X, Y, Z, control, open_loop
from agents.vehicles.bodies.single.state import FLY, Body
from shared.messages import Vector


def fly(body: Body, kind: int, setpoint: Vector, dt: float, substeps: int) -> Body:
    """Advances one Crazyflie with its command held; arguments as for `identified.fly`."""
    (x, y, z), (u, v, w), thrust, wait = body.position, body.velocity, body.thrust, body.wait
    integral, error, output = [*body.integral], [*body.error], [*body.output]
    (p, q), (p_rate, q_rate) = body.tilt, body.tilt_rate
    flying = kind == FLY
    steady, lag = thrust_of(output[Z]), math.exp(-dt / MOTOR_LAG)
    decay = math.exp(-ATTITUDE_BANDWIDTH * dt)
    for _ in range(substeps):
        grounded = z <= 0.0
        if wait <= ROUNDING:
            still, position = (0.0, 0.0, open_loop(kind, output[Z], grounded=grounded)), (x, y, z)
            for axis in (X, Y, Z):
                integral[axis], error[axis], output[axis] = control(
                    axis,
                    setpoint[axis] - position[axis],
                    integral[axis],
                    error[axis],
                    still[axis],
                    flying=flying,
                    grounded=grounded,
                )
            steady = thrust_of(output[Z])
            wait += PERIOD
        wait -= dt
        p1, p_rate = _follow(p, p_rate, 0.0 if grounded else math.radians(output[X]), dt, decay)
        q1, q_rate = _follow(q, q_rate, 0.0 if grounded else math.radians(output[Y]), dt, decay)
        along_x = GRAVITY * math.tan(0.5 * (p + p1)) - DRAG * u
        along_y = GRAVITY * math.tan(0.5 * (q + q1)) - DRAG * v
        later = steady + (thrust - steady) * lag
        x, y, z, u, v, w = move(x, y, z, u, v, w, along_x, along_y, 0.5 * (thrust + later), dt)
        p, q, thrust = p1, q1, later
    (a, b, c), (d, e, f), (g, h, i) = integral, error, output
    vectors = ((x, y, z), (u, v, w), (a, b, c), (d, e, f), (g, h, i))
    return Body(*vectors, (p, q), (p_rate, q_rate), thrust, wait)


def _follow(tilt: float, rate: float, command: float, dt: float, decay: float) -> tuple[float, float]:
    """Returns tilt and its rate after an exact step of `x'' + 2 w x' + w^2 x = w^2 u` with u held."""
    w = ATTITUDE_BANDWIDTH
    offset = tilt - command
    slope = rate + w * offset
    return command + (offset + slope * dt) * decay, (rate - w * slope * dt) * decay
