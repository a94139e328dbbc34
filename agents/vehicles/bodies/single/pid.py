"""The position PID of one body, see `agents.vehicles.bodies.pid`."""

import math

from agents.vehicles.bodies import pid
from agents.vehicles.bodies.pid import DESCENT_PWM, PERIOD
from agents.vehicles.bodies.state import Command

X, Y, Z = range(3)

_IDLE, _CUT, _DESCEND = Command.IDLE.value, Command.CUT.value, Command.DESCEND.value
_GAINS = list(zip(pid.KP.tolist(), pid.KD.tolist(), pid.KI.tolist(), strict=True))
_INTEGRAL_LIMIT = pid.INTEGRAL_LIMIT.tolist()
_OUTPUT_MIN, _OUTPUT_MAX = pid.OUTPUT_MIN.tolist(), pid.OUTPUT_MAX.tolist()
_GROUND_INTEGRAL = pid.GROUND_INTEGRAL.tolist()


def control(
    axis: int, error: float, integral: float, previous: float, output: float, *, flying: bool, grounded: bool
) -> tuple[float, float, float]:
    """Makes one tick of the controller of one axis.

    Args:
        axis: `X`, `Y` or `Z`.
        error: From the body to its set-point, m.
        integral: Of the error, m s.
        previous: Error at the last tick, m; NaN: it was not flying then.
        output: What it is while the body does not fly to its set-point.
        flying: Whether it does.
        grounded: Whether it touches the ground.

    Returns:
        Integral, error and output after the tick.
    """
    if grounded:
        integral = _GROUND_INTEGRAL[axis]
    elif flying:
        limit = _INTEGRAL_LIMIT[axis]
        integral = _clip(integral + error * PERIOD, -limit, limit)
    if not flying:
        return integral, math.nan, output
    rate = 0.0 if math.isnan(previous) else (error - previous) / PERIOD
    kp, kd, ki = _GAINS[axis]
    wanted = kp * error + kd * rate + ki * integral
    return integral, error, _clip(wanted, _OUTPUT_MIN[axis], _OUTPUT_MAX[axis])


def _clip(value: float, low: float, high: float) -> float:
    return low if value < low else high if value > high else value


def open_loop(kind: int, pwm: float, *, grounded: bool) -> float:
    """Returns the motor command without a position: the thrust that the command stands for.

    Args:
        kind: Value of a `Command`.
        pwm: Motor command so far.
        grounded: Whether the body touches the ground.
    """
    if kind == _CUT or (kind == _IDLE and grounded):
        return 0.0
    return DESCENT_PWM if kind in (_DESCEND, _IDLE) else pwm
