"""What a simulated body is (state) and what it can be told (commands), for N bodies at once."""

import enum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Vec = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Kinds = npt.NDArray[np.int8]

AIRBORNE_HEIGHT = 0.03
"""A body higher than this counts as airborne, m."""


class Command(enum.IntEnum):
    """What the motors are for."""

    FLY = 0
    """Fly to the set-point."""
    LEVEL = 1
    """Attitude level, thrust as it was last."""
    DESCEND = 2
    """Attitude level, thrust a little below hover."""
    IDLE = 3
    """Motors off on the ground; in the air the same as DESCEND."""
    CUT = 4
    """Motors off at any height."""


class Commands(NamedTuple):
    """One command per body.

    Attributes:
        kind: (N,) values of `Command`.
        setpoint: (N, 3) world frame, m; read where kind is FLY, finite everywhere.
    """

    kind: Kinds
    setpoint: Vec

    @property
    def flying(self) -> Mask:
        """(N, 1) which bodies fly to their set-point."""
        return self.says(Command.FLY)[:, None]

    def says(self, command: Command) -> Mask:
        """(N,) which bodies got this command."""
        # numpy compares with an enum member five times slower than with its value.
        told: Mask = self.kind == command.value
        return told


class BodyState(NamedTuple):
    """State of N bodies.

    Attributes:
        position: (N, 3) world frame, m.
        velocity: (N, 3) world frame, m/s.
        integral: (N, 3) integral of the position error, m s.
        error: (N, 3) position error at the last controller tick, m; NaN: it was not flying then.
        output: (N, 3) controller output: tilt towards +x and +y, deg, and motor command, PWM.
        tilt: (N, 2) tilt towards +x and +y, rad.
        tilt_rate: (N, 2) rad/s.
        thrust: (N,) N.
        wait: Time to the next controller tick, s.
    """

    position: Vec
    velocity: Vec
    integral: Vec
    error: Vec
    output: Vec
    tilt: Vec
    tilt_rate: Vec
    thrust: Vec
    wait: float

    @property
    def grounded(self) -> Mask:
        """(N,) which bodies touch the ground."""
        return self.position[:, 2] <= 0.0


def at_rest(positions: Vec) -> BodyState:
    """Places bodies at rest with motors off.

    Args:
        positions: (N, 3) world frame, m; heights below the ground are raised to it.
    """
    n = len(positions)
    position = np.array(positions, dtype=np.float64)
    position[:, 2] = np.maximum(position[:, 2], 0.0)
    return BodyState(
        position=position,
        velocity=np.zeros((n, 3)),
        integral=np.zeros((n, 3)),
        error=np.full((n, 3), np.nan),
        output=np.zeros((n, 3)),
        tilt=np.zeros((n, 2)),
        tilt_rate=np.zeros((n, 2)),
        thrust=np.zeros(n),
        wait=0.0,
    )
