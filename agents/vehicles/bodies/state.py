"""What a simulated body is (its state), what it can be told (commands), and what moves it (a model)."""

import enum
import math
from typing import Final, final

from mypy_extensions import mypyc_attr

from agents.control.vectors import ORIGIN, Planar, Vector

AIRBORNE_HEIGHT: Final = 0.03
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


# Python compares members of an enumeration several times slower than their values.
FLY: Final[int] = Command.FLY.value
LEVEL: Final[int] = Command.LEVEL.value
DESCEND: Final[int] = Command.DESCEND.value
IDLE: Final[int] = Command.IDLE.value
CUT: Final[int] = Command.CUT.value


@mypyc_attr(acyclic=True)
@final
class Body:
    """State of one body.

    Attributes:
        position: World frame, m.
        velocity: World frame, m/s.
        integral: Integral of the position error, m s.
        error: Position error at the last controller tick, m; NaN: it was not flying then.
        output: Controller output: tilt towards +x and +y, deg, and motor command, PWM.
        tilt: Towards +x and +y, rad.
        tilt_rate: rad/s.
        thrust: N.
        wait: Time to the next controller tick, s.
    """

    def __init__(
        self,
        position: Vector,
        velocity: Vector,
        integral: Vector,
        error: Vector,
        output: Vector,
        tilt: Planar,
        tilt_rate: Planar,
        thrust: float,
        wait: float,
    ) -> None:
        self.position: Final = position
        self.velocity: Final = velocity
        self.integral: Final = integral
        self.error: Final = error
        self.output: Final = output
        self.tilt: Final = tilt
        self.tilt_rate: Final = tilt_rate
        self.thrust: Final = thrust
        self.wait: Final = wait

    def moved(self, position: Vector, velocity: Vector) -> "Body":
        """Returns the same body elsewhere, or at another speed."""
        return Body(
            position,
            velocity,
            self.integral,
            self.error,
            self.output,
            self.tilt,
            self.tilt_rate,
            self.thrust,
            self.wait,
        )


class Model:
    """The equations of motion of one type of body."""

    def fly(self, body: Body, kind: int, setpoint: Vector, dt: float, substeps: int) -> Body:
        """Advances a body with its command held.

        Args:
            body: Before.
            kind: Value of a `Command`.
            setpoint: World frame, m; read where kind is FLY, finite always.
            dt: Substep, s, at most the controller's 0.02.
            substeps: How many.
        """
        raise NotImplementedError


def at_rest(position: Vector) -> Body:
    """Places a body at rest with motors off; a height below the ground is raised to it, m."""
    x, y, z = position
    unknown = (math.nan, math.nan, math.nan)
    level = (0.0, 0.0)
    return Body((x, y, max(z, 0.0)), ORIGIN, ORIGIN, unknown, ORIGIN, level, level, 0.0, 0.0)
