"""The position PID of crazyflie_ros, 50 Hz on its own clock, for N bodies.

`I <- clip(I + e dt)`, `u = clip(kp e + kd (e - e_prev) / dt + ki I)`: derivative of the error, unfiltered, so
a set-point step kicks once. Outputs are tilt in degrees (x, y) and motor command in PWM (z).
"""

import numpy as np

from agents.vehicles.bodies.airframe import HOVER_PWM, thrust_of
from agents.vehicles.bodies.state import BodyState, Command, Commands, Vec, at_rest

PERIOD = 0.02

KP = np.array([40.0, 40.0, 5000.0])
KD = np.array([20.0, 20.0, 6000.0])
KI = np.array([2.0, 2.0, 3500.0])
INTEGRAL_LIMIT = np.array([0.1, 0.1, 1000.0])
OUTPUT_MIN = np.array([-10.0, -10.0, 10_000.0])
OUTPUT_MAX = np.array([10.0, 10.0, 60_000.0])

DESCENT_PWM = 36_400.0
"""4 % less thrust than weight: from hover at 1.5 m the ground is reached after about 3 s at 0.9 m/s."""

ALL_AXES = slice(0, 3)
VERTICAL = slice(2, 3)

_HOVER_INTEGRAL = np.array([0.0, 0.0, HOVER_PWM / KI[2]])
GROUND_INTEGRAL = 0.99 * _HOVER_INTEGRAL
"""A little less than hover, or a body whose set-point is on the ground would slide about weightless."""
ROUNDING = 1e-9
"""A tick is due within this much of its time, s."""


def hovering(positions: Vec) -> BodyState:
    """Places bodies in a steady hover that has lasted for a while.

    Args:
        positions: (N, 3) world frame, m, above the ground.
    """
    state = at_rest(positions)
    n = len(positions)
    output = np.tile((0.0, 0.0, HOVER_PWM), (n, 1))
    return state._replace(
        integral=np.tile(_HOVER_INTEGRAL, (n, 1)),
        error=np.zeros((n, 3)),
        output=output,
        thrust=thrust_of(output[:, 2]),
    )


def clip(values: Vec, low: Vec | float, high: Vec | float) -> Vec:
    """Does what `np.clip` does, in a third of its time on few bodies."""
    return np.minimum(np.maximum(values, low), high)


def control(state: BodyState, commands: Commands, axes: slice, dt: float) -> BodyState:
    """Runs the controller if its tick is due within this substep.

    On the ground the integrals are held at what lift-off needs: 0 for the tilt and, as crazyflie_ros does
    when its take-off ramp ends, `I_z := thrust / 3500`; without it the drone falls.

    Args:
        state: N bodies.
        commands: One per body.
        axes: Axes that this PID flies; the others' integral and output are left alone.
        dt: Substep, s.
    """
    if state.wait > ROUNDING:
        return state._replace(wait=state.wait - dt)
    flying = commands.flying
    error = np.where(flying, commands.setpoint - state.position, np.nan)[:, axes]
    previous = state.error[:, axes]
    rate = np.where(np.isnan(previous), 0.0, error - previous) / PERIOD
    limit = INTEGRAL_LIMIT[axes]
    integral = clip(state.integral[:, axes] + error * PERIOD, -limit, limit)
    integral = np.where(flying, integral, state.integral[:, axes])
    integral = np.where(state.grounded[:, None], GROUND_INTEGRAL[axes], integral)
    wanted = KP[axes] * error + KD[axes] * rate + KI[axes] * integral
    output = _open_loop(state, commands)
    output[:, axes] = np.where(flying, clip(wanted, OUTPUT_MIN[axes], OUTPUT_MAX[axes]), output[:, axes])
    return state._replace(
        integral=_with(state.integral, axes, integral),
        error=_with(state.error, axes, error),
        output=output,
        wait=state.wait + PERIOD - dt,
    )


def _open_loop(state: BodyState, commands: Commands) -> Vec:
    """Output without a position: level, and the thrust that the command stands for."""
    idle = commands.says(Command.IDLE)
    off = commands.says(Command.CUT) | (idle & state.grounded)
    descending = commands.says(Command.DESCEND) | idle
    output = np.zeros_like(state.output)
    output[:, 2] = np.where(off, 0.0, np.where(descending, DESCENT_PWM, state.output[:, 2]))
    return output


def _with(array: Vec, axes: slice, values: Vec) -> Vec:
    changed = array.copy()
    changed[:, axes] = values
    return changed
