"""The position PID of one body, see `agents.vehicles.bodies.pid`."""

import math

from agents.vehicles.bodies import pid
from agents.vehicles.bodies.pid import DESCENT_PWM, PERIOD, ROUNDING
from agents.vehicles.bodies.single.state import FLY, Body, clip
from agents.vehicles.bodies.state import Command
from shared.messages import Vector

ALL_AXES, VERTICAL = (range(3)[axes] for axes in (pid.ALL_AXES, pid.VERTICAL))

_IDLE, _CUT, _DESCEND = Command.IDLE.value, Command.CUT.value, Command.DESCEND.value
_GAINS = list(zip(pid.KP.tolist(), pid.KD.tolist(), pid.KI.tolist(), strict=True))
_INTEGRAL_LIMIT = pid.INTEGRAL_LIMIT.tolist()
_OUTPUT_MIN, _OUTPUT_MAX = pid.OUTPUT_MIN.tolist(), pid.OUTPUT_MAX.tolist()
_GROUND_INTEGRAL = pid.GROUND_INTEGRAL.tolist()


def control(
    body: Body, integral: Vector, kind: int, setpoint: Vector, axes: range, dt: float
) -> tuple[Vector, Vector, Vector, float]:
    """Runs the controller if its tick is due within this substep.

    Args:
        body: Before the substep.
        integral: Its integral, where something else than this PID has changed it, else its own.
        kind: Value of a `Command`.
        setpoint: m.
        axes: Axes that this PID flies; the others' integral and output are left alone.
        dt: Substep, s.

    Returns:
        Integral, error, output and wait of the body after the substep.
    """
    if body.wait > ROUNDING:
        return (integral, body.error, body.output, body.wait - dt)
    integrals, errors = [*integral], [*body.error]
    outputs = [0.0, 0.0, _open_loop(body, kind)]
    for axis in axes:
        error = setpoint[axis] - body.position[axis] if kind == FLY else math.nan
        limit = _INTEGRAL_LIMIT[axis]
        if body.position[2] <= 0.0:
            integrals[axis] = _GROUND_INTEGRAL[axis]
        elif kind == FLY:
            integrals[axis] = clip(integrals[axis] + error * PERIOD, -limit, limit)
        if kind == FLY:
            previous = errors[axis]
            rate = 0.0 if math.isnan(previous) else (error - previous) / PERIOD
            kp, kd, ki = _GAINS[axis]
            wanted = kp * error + kd * rate + ki * integrals[axis]
            outputs[axis] = clip(wanted, _OUTPUT_MIN[axis], _OUTPUT_MAX[axis])
        errors[axis] = error
    (a, b, c), (d, e, f), (g, h, i) = integrals, errors, outputs
    return (a, b, c), (d, e, f), (g, h, i), body.wait + PERIOD - dt


def _open_loop(body: Body, kind: int) -> float:
    """Returns the motor command without a position: the thrust that the command stands for."""
    if kind == _CUT or (kind == _IDLE and body.position[2] <= 0.0):
        return 0.0
    return DESCENT_PWM if kind in (_DESCEND, _IDLE) else body.output[2]
