"""Bodies in flight: each with its model, advanced over any duration in substeps."""

import math
from collections.abc import Mapping, Sequence
from typing import Final, final

from mypy_extensions import mypyc_attr

from agents.control.vectors import ORIGIN, Vector
from agents.vehicles.base import Pose
from agents.vehicles.bodies.crazyflie import Crazyflie
from agents.vehicles.bodies.identified import Identified
from agents.vehicles.bodies.pid import hovering
from agents.vehicles.bodies.state import AIRBORNE_HEIGHT, Body, Model, at_rest

SUBSTEP: Final = 0.004
"""Longest substep, s (250 Hz)."""

BODIES: Final[dict[str, Model]] = {"identified": Identified(), "crazyflie": Crazyflie()}
"""Body type of a scenario (`vehicles.*.body`) -> what moves it."""


@mypyc_attr(acyclic=True)
@final
class Flyer:
    """One body, what moves it, and whether a hand holds it in place."""

    def __init__(self, body: Body, model: Model, *, held: bool = False) -> None:
        self.body: Final = body
        self.model: Final = model
        self.held: Final = held

    @property
    def airborne(self) -> bool:
        """Whether it is clear of the ground."""
        return self.body.position[2] > AIRBORNE_HEIGHT


Fleet = dict[int, Flyer]
"""Number of a drone -> its body."""


def park_fleet(bodies: Mapping[int, str], places: Sequence[Vector]) -> Fleet:
    """Places a fleet at rest with motors off.

    Args:
        bodies: Number of each drone -> its type, a key of `BODIES`.
        places: In the same order, world frame, m.
    """
    pairs = zip(bodies.items(), places, strict=True)
    return {drone: Flyer(at_rest(place), BODIES[body]) for (drone, body), place in pairs}


def hover(flyer: Flyer, *, held: bool = False) -> Flyer:
    """Returns the same flyer in a steady hover where it is, held in place by a hand or not."""
    return Flyer(hovering(flyer.body.position), flyer.model, held=held)


def hold(flyer: Flyer, *, held: bool = True) -> Flyer:
    """Returns the same flyer held in place by a hand, or let go."""
    return Flyer(flyer.body, flyer.model, held=held)


def advance(flyer: Flyer, kind: int, setpoint: Vector, duration: float) -> Flyer:
    """Advances one body with its command held.

    Args:
        flyer: Before.
        kind: Value of a `Command`.
        setpoint: World frame, m.
        duration: s, >= 0; cut into equal substeps of at most `SUBSTEP`.
    """
    # The tolerance keeps 0.012 s, which is not three times 0.004 in floating point, at three substeps.
    substeps = math.ceil(duration / SUBSTEP - 1e-9)
    if substeps <= 0:
        return flyer
    body = flyer.model.fly(flyer.body, kind, setpoint, duration / float(substeps), substeps)
    if flyer.held:
        body = body.moved(flyer.body.position, ORIGIN)
    return Flyer(body, flyer.model, held=flyer.held)


def pose_of(flyer: Flyer, charge: float, seq: int) -> Pose:
    """Returns what its vehicle reports.

    Args:
        flyer: The body now.
        charge: Of its battery, 0..1.
        seq: Number of this report.
    """
    return Pose(flyer.body.position, flyer.body.velocity, 0.0, charge, flyer.airborne, seq)
