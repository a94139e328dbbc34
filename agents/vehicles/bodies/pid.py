"""The position PID of crazyflie_ros, 50 Hz on its own clock, axis by axis.

`I <- clip(I + e dt)`, `u = clip(kp e + kd (e - e_prev) / dt + ki I)`: derivative of the error, unfiltered, so
a set-point step kicks once. Outputs are tilt in degrees (x, y) and motor command in PWM (z).
"""

import math
from dataclasses import dataclass
from typing import Final, final

from agents.control.vectors import ORIGIN, Vector, clip
from agents.vehicles.bodies.airframe import HOVER_PWM, thrust_of
from agents.vehicles.bodies.state import CUT, DESCEND, IDLE, Body

PERIOD: Final = 0.02

DESCENT_PWM: Final = 36_400.0
"""4 % less thrust than weight: from hover at 1.5 m the ground is reached after about 3 s at 0.9 m/s."""

ROUNDING: Final = 1e-9
"""A tick is due within this much of its time, s."""

Tick = tuple[float, float, float]
"""Integral of the error, m s; error, m; output: after a tick of the controller."""


@final
@dataclass(frozen=True)
class Pid:
    """The controller of one axis.

    Attributes:
        kp: Gain on the error.
        kd: On its rate.
        ki: On its integral.
        limit: Bound of the integral, m s.
        low: Smallest output.
        high: Largest output.
        grounded: Integral on the ground, m s.
    """

    kp: float
    kd: float
    ki: float
    limit: float
    low: float
    high: float
    grounded: float

    def tick(
        self, error: float, integral: float, previous: float, output: float, *, flying: bool, grounded: bool
    ) -> Tick:
        """Makes one tick.

        On the ground the integral is held at what lift-off needs: 0 for the tilt and, as crazyflie_ros does
        when its take-off ramp ends, `I_z := thrust / 3500`; without it the drone falls.

        Args:
            error: From the body to its set-point, m.
            integral: Of the error, m s.
            previous: Error at the last tick, m; NaN: it was not flying then.
            output: What it is while the body does not fly to its set-point.
            flying: Whether it does.
            grounded: Whether it touches the ground.
        """
        if grounded:
            integral = self.grounded
        elif flying:
            integral = clip(integral + error * PERIOD, -self.limit, self.limit)
        if not flying:
            return (integral, math.nan, output)
        rate = 0.0 if math.isnan(previous) else (error - previous) / PERIOD
        wanted = self.kp * error + self.kd * rate + self.ki * integral
        return (integral, error, clip(wanted, self.low, self.high))


_LIFT_GAIN: Final = 3500.0
_HOVER_INTEGRAL: Final = HOVER_PWM / _LIFT_GAIN

TILT: Final = Pid(40.0, 20.0, 2.0, limit=0.1, low=-10.0, high=10.0, grounded=0.0)
# On the ground a little less than hover, or a body with its set-point there would slide about weightless.
LIFT: Final = Pid(
    5000.0, 6000.0, _LIFT_GAIN, limit=1000.0, low=10_000.0, high=60_000.0, grounded=0.99 * _HOVER_INTEGRAL
)


def open_loop(kind: int, pwm: float, *, grounded: bool) -> float:
    """Returns the motor command without a position: the thrust that the command stands for.

    Args:
        kind: Value of a `Command`.
        pwm: Motor command so far.
        grounded: Whether the body touches the ground.
    """
    if kind == CUT or (kind == IDLE and grounded):
        return 0.0
    return DESCENT_PWM if kind in (DESCEND, IDLE) else pwm


def hovering(position: Vector) -> Body:
    """Places a body in a steady hover that has lasted for a while, above the ground, m."""
    output = (0.0, 0.0, HOVER_PWM)
    integral = (0.0, 0.0, _HOVER_INTEGRAL)
    level = (0.0, 0.0)
    return Body(position, ORIGIN, integral, ORIGIN, output, level, level, thrust_of(HOVER_PWM), 0.0)
