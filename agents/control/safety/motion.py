"""What is known about the own body, and where it will be once it has answered."""

from typing import Final, final

from mypy_extensions import mypyc_attr

from agents.control.safety.response import Axis, Response, observe, start_axis
from agents.control.vectors import Vector
from shared.plausibility import LONGEST_LOOK


@mypyc_attr(acyclic=True)
@final
class Motion:
    """What is known about the own body.

    Attributes:
        x: Axis.
        y: The same.
        z: The same.
        age: Of the pose, s.
    """

    def __init__(self, x: Axis, y: Axis, z: Axis, age: float) -> None:
        self.x: Final = x
        self.y: Final = y
        self.z: Final = z
        self.age: Final = age


def start_motion(position: Vector, velocity: Vector, age: float) -> Motion:
    """Returns what is known of a body that has not been told anything."""
    x, y, z = position
    u, v, w = velocity
    return Motion(start_axis(x, u), start_axis(y, v), start_axis(z, w), age)


def watch(
    motion: Motion,
    position: Vector,
    velocity: Vector,
    age: float,
    dt: float,
    horizontal: Response,
    vertical: Response,
) -> Motion:
    """Takes in a pose.

    Args:
        motion: After the last step.
        position: m.
        velocity: m/s.
        age: Of the pose, s.
        dt: Time since the last step, s.
        horizontal: How the vehicle answers.
        vertical: The same.
    """
    x, y, z = position
    u, v, w = velocity
    between = dt + motion.age - age
    return Motion(
        observe(motion.x, x, u, between, horizontal),
        observe(motion.y, y, v, between, horizontal),
        observe(motion.z, z, w, between, vertical),
        age,
    )


def point_ahead(motion: Motion, horizontal: Response, vertical: Response) -> tuple[Vector, Vector]:
    """Returns where the body will be once it has answered, now and not when the pose was measured."""
    x, y, z, age = motion.x, motion.y, motion.z, min(motion.age, LONGEST_LOOK)
    across, up = horizontal.lag + age, vertical.lag + age
    ahead = (x.position + across * x.velocity, y.position + across * y.velocity, z.position + up * z.velocity)
    pace = (x.velocity + across * x.actual, y.velocity + across * y.actual, z.velocity + up * z.actual)
    return ahead, pace
