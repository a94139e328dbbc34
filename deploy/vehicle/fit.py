"""Fits the model of `agents.control.safety.response` to how a body moved. Pure.

With the lag multiplied out and an integrator beside the rest, the model is linear in its parameters,

    p'' = stiffness (s - p) + feed s' - damping p' - lag p''' + integral int(s - p) + constant,

so least squares with bounds find them all. Multiplied by `1 + T d/dt` the same equation holds with other
numbers and a longer lag: the shortest lag that explains the motion about as well as any is the vehicle's. Both
sides are smoothed by the same kernel: that changes nothing between them, and takes noise out of derivatives.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from agents.control.safety.response import Response, observe, observed_share, start_axis, tell
from deploy.vehicle.motion import RATE_HZ
from shared.arrays import Vec

SMOOTH = 3.0
"""Standard deviation of the kernel, rows."""
SETTLED = 60
"""Rows after which the observer knows what is left over."""
SHARE = 0.99
"""Of the errors, as the largest one."""
_TENTH = 6
"""Rows over which errors are averaged: shorter ones move nobody."""
_EDGE = 15
"""Rows at both ends where the kernel has not all that it smooths."""
LAGS = np.arange(0.0, 0.6, 0.005)
"""The lags that are tried, s."""
ABOUT = 0.01
"""Two models explain a motion about equally well if this share of it makes the difference."""
_DT = 1.0 / RATE_HZ


class Fitted(NamedTuple):
    """What was found for one axis.

    Attributes:
        stiffness: 1/s^2.
        damping: 1/s.
        feed: 1/s.
        lag: s.
        error: What the model and its observer leave over, m/s^2.
        rms: Of the accelerations that the model does not explain, m/s^2.
        seen: Largest acceleration in the data, m/s^2.
    """

    stiffness: float
    damping: float
    feed: float
    lag: float
    error: float
    rms: float
    seen: float


def fit_axis(setpoints: Sequence[Vec], positions: Sequence[Vec], acceleration: float) -> Fitted:
    """Fits one axis.

    Args:
        setpoints: Stretches (T,), m, each longer than the observer needs to settle.
        positions: The same of the body, m.
        acceleration: That the vehicle can be asked for, m/s^2; infinite: what is seen.
    """
    sides = [_equation(setpoint, position) for setpoint, position in zip(setpoints, positions, strict=True)]
    terms, moved, jerk = (np.concatenate(column) for column in zip(*sides, strict=True))
    tried = [_solve(terms, moved + lag * jerk) for lag in LAGS]
    enough = min(rms for _, rms in tried) + ABOUT * float(np.std(moved))
    lag, (solved, rms) = next(each for each in zip(LAGS.tolist(), tried, strict=True) if each[1][1] <= enough)
    stiffness, feed, damping, _ = solved.tolist()
    seen = float(np.abs(moved).max())
    response = Response(
        stiffness=stiffness, damping=damping, feed=feed, lag=lag, acceleration=min(acceleration, 2.0 * seen)
    )
    left = [
        _left_over(response, setpoint, position)
        for setpoint, position in zip(setpoints, positions, strict=True)
    ]
    error = float(np.quantile(np.abs(np.concatenate(left)), SHARE))
    return Fitted(stiffness, damping, feed, lag, error, rms, seen)


def delay_of(setpoints: Sequence[Vec], positions: Sequence[Vec]) -> float:
    """Returns by what time bodies are behind their set-points on the average, s."""

    def miss(rows: int) -> float:
        pairs = zip(setpoints, positions, strict=True)
        return sum(float(((p[rows:] - s[: len(s) - rows]) ** 2).sum()) for s, p in pairs)

    return min(range(round(RATE_HZ)), key=miss) / RATE_HZ


def _solve(terms: Vec, wanted: Vec) -> tuple[Vec, float]:
    """Returns the factors of the terms, none of them negative, and the RMS of what they leave over."""
    factors, left = nnls(terms, wanted)
    return factors, float(left) / math.sqrt(len(wanted))


def _equation(setpoint: Vec, position: Vec) -> tuple[Vec, Vec, Vec]:
    """Returns the terms (T, 4) of a stretch, its acceleration (T,) and jerk (T,), all without their means."""
    # A set-point is held until the next: at a row's time it is, on the average, between two.
    held = 0.5 * (setpoint + np.concatenate([setpoint[:1], setpoint[:-1]]))
    told, seen = _smooth(held), _smooth(position)
    speed = np.gradient(seen, _DT)
    acceleration = np.gradient(speed, _DT)
    terms = (
        told - seen,
        np.gradient(told, _DT),
        -speed,
        np.cumsum(told - seen) * _DT,
    )
    inner = slice(_EDGE, -_EDGE)
    columns = (np.stack(terms, axis=1), acceleration, np.gradient(acceleration, _DT))
    known, moved, jerk = (column[inner] - column[inner].mean(axis=0) for column in columns)
    return known, moved, jerk


def _smooth(values: Vec) -> Vec:
    reach = np.arange(-_EDGE, _EDGE + 1)
    kernel = np.exp(-0.5 * (reach / SMOOTH) ** 2)
    padded = np.pad(values, _EDGE, mode="edge")
    smoothed: Vec = np.convolve(padded, kernel / kernel.sum(), mode="valid")
    return smoothed


def _left_over(response: Response, setpoint: Vec, position: Vec) -> Vec:
    """Returns what the observer is surprised by along a stretch, m/s^2, averaged over a tenth of a second."""
    velocity = np.gradient(_smooth(position), _DT)
    axis, surprises = start_axis(float(position[0]), float(velocity[0])), []
    share = observed_share(_DT, response.lag)
    rows = zip(setpoint.tolist(), position[1:].tolist(), velocity[1:].tolist(), strict=False)
    for wanted, place, speed in rows:
        axis = tell(wanted, axis, _DT)
        after = observe(axis, place, speed, _DT, response)
        surprises.append((after.rest - axis.rest) / share)
        axis = after
    averaged: Vec = np.convolve(surprises[SETTLED:], np.full(_TENTH, 1.0 / _TENTH), mode="valid")
    return averaged
