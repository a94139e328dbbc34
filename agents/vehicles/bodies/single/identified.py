"""One body fitted on the recorded flights, see `agents.vehicles.bodies.identified`."""

from agents.vehicles.bodies.airframe import DRAG
from agents.vehicles.bodies.identified import (
    ACCELERATION_LIMIT,
    DAMPING,
    INTEGRAL_GAIN,
    INTEGRAL_LIMIT,
    STIFFNESS,
)
from agents.vehicles.bodies.single.airframe import move
from agents.vehicles.bodies.single.pid import VERTICAL, control
from agents.vehicles.bodies.single.state import FLY, Body, clip
from shared.messages import Vector


def step(body: Body, kind: int, setpoint: Vector, dt: float) -> Body:
    """Advances one identified body by one substep.

    Args:
        body: Before.
        kind: Value of a `Command`.
        setpoint: m.
        dt: Substep, s, at most the controller's 0.02.
    """
    position, velocity, (a, b, c), _, _, tilt, tilt_rate, thrust, _ = body
    (x, y, z), (u, v, _) = position, velocity
    horizontal = (-DRAG * u, -DRAG * v)
    if z <= 0.0:
        a = b = 0.0
    if kind == FLY:
        ex, ey = setpoint[0] - x, setpoint[1] - y
        if z > 0.0:
            a = clip(a + ex * dt, -INTEGRAL_LIMIT, INTEGRAL_LIMIT)
            b = clip(b + ey * dt, -INTEGRAL_LIMIT, INTEGRAL_LIMIT)
        horizontal = (
            clip(STIFFNESS * ex - DAMPING * u + INTEGRAL_GAIN * a, -ACCELERATION_LIMIT, ACCELERATION_LIMIT),
            clip(STIFFNESS * ey - DAMPING * v + INTEGRAL_GAIN * b, -ACCELERATION_LIMIT, ACCELERATION_LIMIT),
        )
    integral, error, output, wait = control(body, (a, b, c), kind, setpoint, VERTICAL, dt)
    position, velocity, thrust = move(position, velocity, thrust, output[2], horizontal, dt)
    return Body(position, velocity, integral, error, output, tilt, tilt_rate, thrust, wait)
