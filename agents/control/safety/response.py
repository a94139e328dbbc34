"""How a vehicle answers to its set-point, and which set-point makes it accelerate as wanted.

Each axis of a vehicle under its own position controller is, measured (docs/safety.md), close to

    asked = stiffness (setpoint - position) + feed setpoint' - damping velocity + rest,  |asked| <= acceleration
    actual' = (asked - actual) / lag

`rest` is what the other terms leave over: the controller's integrator, wind, a parameter that is a little
wrong. It is observed, from how the body really moves.

With the *point ahead* `position + lag velocity` and its *pace* `velocity + lag actual`, pace' = asked: the
point ahead is a double integrator that obeys at once. The body follows it as a low-pass of time constant `lag`
does: its position is a mean of where the point ahead has been, and so never leaves a convex set that the point
stays in. That is why the safety filter works on points ahead.
"""

import math
from dataclasses import dataclass
from typing import Final, final

from mypy_extensions import mypyc_attr

from shared.plausibility import LONGEST_LOOK

OBSERVED_WITHIN: Final = 0.12
"""Time constant with which `rest` is observed, s; twice the lag is added to it."""
LARGEST_REST: Final = 0.6
"""Bound of `rest` as a multiple of the acceleration: no model holds for a body that is held, or stands."""
SHORTEST_LOOK: Final = 2e-3
"""Two poses that are closer in time than this say nothing about accelerations, s, and nothing about the present
one those that are farther apart than `LONGEST_LOOK`."""


@final
@dataclass(frozen=True, kw_only=True)
class Response:
    """Parameters of one axis.

    Attributes:
        stiffness: 1/s^2.
        damping: 1/s.
        feed: Of the set-point's velocity, 1/s.
        lag: From what is asked for to what happens, s.
        acceleration: Largest that can be asked for, m/s^2.
    """

    stiffness: float
    damping: float
    feed: float
    lag: float
    acceleration: float

    def asks(self, error: float, rate: float, velocity: float, rest: float) -> float:
        """Returns what acceleration is asked for, m/s^2.

        Args:
            error: From the body to its set-point, m.
            rate: Velocity of the set-point, m/s.
            velocity: Of the body, m/s.
            rest: m/s^2.
        """
        asked = self.stiffness * error + self.feed * rate - self.damping * velocity + rest
        return min(max(asked, -self.acceleration), self.acceleration)


@mypyc_attr(acyclic=True)
@final
class Axis:
    """What is known about one axis of the own body.

    Attributes:
        position: m.
        velocity: m/s.
        actual: Acceleration as the model has it, m/s^2.
        rest: What the model leaves over, m/s^2.
        setpoint: The one that was sent last, m.
        rate: Its velocity, m/s.
    """

    def __init__(
        self, position: float, velocity: float, actual: float, rest: float, setpoint: float, rate: float
    ) -> None:
        self.position: Final = position
        self.velocity: Final = velocity
        self.actual: Final = actual
        self.rest: Final = rest
        self.setpoint: Final = setpoint
        self.rate: Final = rate


def start_axis(position: float, velocity: float) -> Axis:
    """Returns what is known of a body that has not been told anything."""
    return Axis(position, velocity, 0.0, 0.0, position, 0.0)


def observe(axis: Axis, position: float, velocity: float, dt: float, response: Response) -> Axis:
    """Takes in how the body has moved.

    Args:
        axis: At the last pose.
        position: Now, m.
        velocity: Now, m/s.
        dt: Time between the two poses, s.
        response: Of this axis.
    """
    if dt < SHORTEST_LOOK:
        return axis
    if dt > LONGEST_LOOK:
        return Axis(position, velocity, 0.0, axis.rest, axis.setpoint, 0.0)
    middle, mean_velocity = 0.5 * (position + axis.position), 0.5 * (velocity + axis.velocity)
    asked = response.asks(axis.setpoint - middle, axis.rate, mean_velocity, axis.rest)
    mean = actual = asked
    if response.lag > 0.0:
        decay = math.exp(-dt / response.lag)
        actual = asked + (axis.actual - asked) * decay
        mean = asked + (axis.actual - asked) * (1.0 - decay) * response.lag / dt
    surprise = (velocity - axis.velocity) / dt - mean
    share = observed_share(dt, response.lag)
    bound = LARGEST_REST * response.acceleration
    # Who does all it can tells nothing more: what was thought of a body that was held does not outlast that.
    known = axis.rest if abs(asked) < response.acceleration else axis.rest * (1.0 - share)
    rest = min(max(known + share * surprise, -bound), bound)
    return Axis(position, velocity, actual, rest, axis.setpoint, axis.rate)


def observed_share(dt: float, lag: float) -> float:
    """Returns the share of a surprise that `rest` takes in within a time, s."""
    return 1.0 - math.exp(-dt / (OBSERVED_WITHIN + 2.0 * lag))


def asked_by(setpoint: float, axis: Axis, dt: float, response: Response) -> float:
    """Returns the acceleration that a set-point asks for if it is sent now, m/s^2.

    Args:
        setpoint: m.
        axis: What is known.
        dt: Time since the last set-point was sent, s.
        response: Of this axis.
    """
    rate = (setpoint - axis.setpoint) / dt
    return response.asks(setpoint - axis.position, rate, axis.velocity, axis.rest)


def setpoint_for(asked: float, axis: Axis, dt: float, response: Response) -> float:
    """Returns the set-point that asks for an acceleration, m; `asked_by` the other way round."""
    wanted = asked + response.stiffness * axis.position + response.damping * axis.velocity - axis.rest
    feed = response.feed / dt
    return (wanted + feed * axis.setpoint) / (response.stiffness + feed)


def tell(setpoint: float, axis: Axis, dt: float) -> Axis:
    """Notes the set-point that is sent."""
    rate = (setpoint - axis.setpoint) / dt
    return Axis(axis.position, axis.velocity, axis.actual, axis.rest, setpoint, rate)
