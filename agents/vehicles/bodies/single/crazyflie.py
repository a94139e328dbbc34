"""One Crazyflie, see `agents.vehicles.bodies.crazyflie`."""

import math

from agents.vehicles.bodies.airframe import DRAG, GRAVITY, MOTOR_LAG, thrust_of
from agents.vehicles.bodies.crazyflie import ATTITUDE_BANDWIDTH
from agents.vehicles.bodies.pid import PERIOD, ROUNDING
from agents.vehicles.bodies.single.airframe import move
from agents.vehicles.bodies.single.pid import ALL_AXES, control
from agents.vehicles.bodies.single.state import Body
from shared.messages import Vector


def fly(body: Body, kind: int, setpoint: Vector, dt: float, substeps: int) -> Body:
    """Advances one Crazyflie with its command held; arguments as for `identified.fly`."""
    position, velocity, integral, error, output, (p, q), (p_rate, q_rate), thrust, wait = body
    steady, lag = thrust_of(output[2]), math.exp(-dt / MOTOR_LAG)
    decay = math.exp(-ATTITUDE_BANDWIDTH * dt)
    for _ in range(substeps):
        if wait <= ROUNDING:
            integral, error, output = control(position, integral, error, output, kind, setpoint, ALL_AXES)
            steady = thrust_of(output[2])
            wait += PERIOD
        wait -= dt
        grounded = position[2] <= 0.0
        p1, p_rate = _follow(p, p_rate, 0.0 if grounded else math.radians(output[0]), dt, decay)
        q1, q_rate = _follow(q, q_rate, 0.0 if grounded else math.radians(output[1]), dt, decay)
        along_x = GRAVITY * math.tan(0.5 * (p + p1)) - DRAG * velocity[0]
        along_y = GRAVITY * math.tan(0.5 * (q + q1)) - DRAG * velocity[1]
        later = steady + (thrust - steady) * lag
        position, velocity = move(position, velocity, along_x, along_y, 0.5 * (thrust + later), dt)
        p, q, thrust = p1, q1, later
    return Body(position, velocity, integral, error, output, (p, q), (p_rate, q_rate), thrust, wait)


def _follow(tilt: float, rate: float, command: float, dt: float, decay: float) -> tuple[float, float]:
    """Returns tilt and its rate after an exact step of `x'' + 2 w x' + w^2 x = w^2 u` with u held."""
    w = ATTITUDE_BANDWIDTH
    offset = tilt - command
    slope = rate + w * offset
    return command + (offset + slope * dt) * decay, (rate - w * slope * dt) * decay
