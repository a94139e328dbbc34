"""The position PID of one body, see `agents.vehicles.bodies.pid`."""

import math

from agents.vehicles.bodies import pid
from agents.vehicles.bodies.pid import DESCENT_PWM, PERIOD
from agents.vehicles.bodies.single.state import FLY, bound
from agents.vehicles.bodies.state import Command
from shared.messages import Vector

ALL_AXES, VERTICAL = (range(3)[axes] for axes in (pid.ALL_AXES, pid.VERTICAL))

_IDLE, _CUT, _DESCEND = Command.IDLE.value, Command.CUT.value, Command.DESCEND.value
_GAINS = list(zip(pid.KP.tolist(), pid.KD.tolist(), pid.KI.tolist(), strict=True))
_INTEGRAL_LIMIT = pid.INTEGRAL_LIMIT.tolist()
_OUTPUT_MIN, _OUTPUT_MAX = pid.OUTPUT_MIN.tolist(), pid.OUTPUT_MAX.tolist()
_GROUND_INTEGRAL = pid.GROUND_INTEGRAL.tolist()


def control(
    position: Vector,
    integral: Vector,
    error: Vector,
    output: Vector,
    kind: int,
    setpoint: Vector,
    axes: range,
) -> tuple[Vector, Vector, Vector]:
    """Makes one tick of the controller.

    Args:
        position: Of the body, m.
        integral: Of the error, m s.
        error: At the last tick, m; NaN: it was not flying then.
        output: Of the last tick.
        kind: Value of a `Command`.
        setpoint: m.
        axes: Axes that this PID flies; the others' integral and output are left alone.

    Returns:
        Integral, error and output after the tick.
    """
    grounded = position[2] <= 0.0
    integrals, errors = [*integral], [*error]
    outputs = [0.0, 0.0, _open_loop(kind, output[2], grounded=grounded)]
    for axis in axes:
        way = setpoint[axis] - position[axis] if kind == FLY else math.nan
        if grounded:
            integrals[axis] = _GROUND_INTEGRAL[axis]
        elif kind == FLY:
            integrals[axis] = bound(integrals[axis] + way * PERIOD, _INTEGRAL_LIMIT[axis])
        if kind == FLY:
            previous = errors[axis]
            rate = 0.0 if math.isnan(previous) else (way - previous) / PERIOD
            kp, kd, ki = _GAINS[axis]
            wanted = kp * way + kd * rate + ki * integrals[axis]
            outputs[axis] = min(max(wanted, _OUTPUT_MIN[axis]), _OUTPUT_MAX[axis])
        errors[axis] = way
    (a, b, c), (d, e, f), (g, h, i) = integrals, errors, outputs
    return (a, b, c), (d, e, f), (g, h, i)


def _open_loop(kind: int, pwm: float, *, grounded: bool) -> float:
    """Returns the motor command without a position: the thrust that the command stands for."""
    if kind == _CUT or (kind == _IDLE and grounded):
        return 0.0
    return DESCENT_PWM if kind in (_DESCEND, _IDLE) else pwm
