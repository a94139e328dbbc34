"""One Crazyflie, see `agents.vehicles.bodies.crazyflie`."""

import math

from agents.vehicles.bodies.airframe import DRAG, GRAVITY
from agents.vehicles.bodies.crazyflie import ATTITUDE_BANDWIDTH
from agents.vehicles.bodies.single.airframe import move
from agents.vehicles.bodies.single.pid import ALL_AXES, control
from agents.vehicles.bodies.single.state import Body
from shared.messages import Vector


def step(body: Body, kind: int, setpoint: Vector, dt: float) -> Body:
    """Advances one Crazyflie by one substep; arguments as for `identified.step`."""
    integral, error, output, wait = control(body, body.integral, kind, setpoint, ALL_AXES, dt)
    grounded = body.position[2] <= 0.0
    (p, q), (u, v, _), (pr, qr) = body.tilt, body.velocity, body.tilt_rate
    p1, pr1 = _follow(p, pr, 0.0 if grounded else math.radians(output[0]), dt)
    q1, qr1 = _follow(q, qr, 0.0 if grounded else math.radians(output[1]), dt)
    horizontal = (
        GRAVITY * math.tan(0.5 * (p + p1)) - DRAG * u,
        GRAVITY * math.tan(0.5 * (q + q1)) - DRAG * v,
    )
    position, velocity, thrust = move(body.position, body.velocity, body.thrust, output[2], horizontal, dt)
    return Body(position, velocity, integral, error, output, (p1, q1), (pr1, qr1), thrust, wait)


def _follow(tilt: float, rate: float, command: float, dt: float) -> tuple[float, float]:
    """Returns tilt and its rate after an exact step of `x'' + 2 w x' + w^2 x = w^2 u` with u held."""
    w = ATTITUDE_BANDWIDTH
    offset = tilt - command
    slope = rate + w * offset
    decay = math.exp(-w * dt)
    return command + (offset + slope * dt) * decay, (rate - w * slope * dt) * decay
