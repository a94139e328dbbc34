"""The filter: what the mission wants if that is safe, else the nearest acceleration that is.

Horizontally all demands are half-planes of accelerations, and `halfplanes.nearest` takes the nearest one
inside all of them. Vertically they are an interval. Where nothing demands anything, the mission's set-point
goes through as it is. Where it is refused, what the mission wants is its velocity, within its limit of
acceleration: the set-point lies ahead of the body for the sake of the vehicle's lag, and tells no haste.
"""

import math
from typing import Final, final

from mypy_extensions import mypyc_attr

from agents.control.safety.demands import Demands, SafetySettings, demands_on
from agents.control.safety.encounter import Encounter
from agents.control.safety.halfplanes import nearest
from agents.control.safety.motion import Motion, point_ahead
from agents.control.safety.response import asked_by, setpoint_for, tell
from agents.control.vectors import Planar, Vector, clip


@mypyc_attr(acyclic=True, free_list_len=1)
@final
class Wish:
    """What the mission wants.

    Attributes:
        setpoint: m.
        velocity: m/s.
        acceleration: How hard it may accelerate towards that velocity, m/s^2.
    """

    def __init__(self, setpoint: Vector, velocity: Vector, acceleration: float) -> None:
        self.setpoint: Final = setpoint
        self.velocity: Final = velocity
        self.acceleration: Final = acceleration


@mypyc_attr(acyclic=True, free_list_len=1)
@final
class Guarded:
    """What is done.

    Attributes:
        setpoint: m.
        motion: With that set-point told.
        ahead: Point ahead, m.
        pace: Velocity of that, m/s.
        asked: Acceleration of that, m/s^2.
        planar: Whether it is something else than the mission wants, horizontally.
        upright: The same, vertically.
        kept: Whether all demands could be met.
    """

    def __init__(
        self,
        setpoint: Vector,
        motion: Motion,
        ahead: Vector,
        pace: Vector,
        asked: Vector,
        *,
        planar: bool,
        upright: bool,
        kept: bool,
    ) -> None:
        self.setpoint: Final = setpoint
        self.motion: Final = motion
        self.ahead: Final = ahead
        self.pace: Final = pace
        self.asked: Final = asked
        self.planar: Final = planar
        self.upright: Final = upright
        self.kept: Final = kept


def guard(
    wish: Wish,
    motion: Motion,
    walkers: list[Encounter],
    drones: list[Encounter],
    settings: SafetySettings,
    dt: float,
    *,
    floor: bool,
) -> Guarded:
    """Decides what the vehicle is told.

    Args:
        wish: What the mission wants.
        motion: The own body.
        walkers: What there is to keep away from, beside columns and fence: who does not look.
        drones: The same: other drones.
        settings: Vehicle, barriers and bounds.
        dt: Time since the last step, s.
        floor: Whether the lower bound of the height holds: not while taking off or landing.
    """
    horizontal, vertical = settings.horizontal, settings.vertical
    ahead, pace = point_ahead(motion, horizontal, vertical)
    x, y, z = wish.setpoint
    a, b = asked_by(x, motion.x, dt, horizontal), asked_by(y, motion.y, dt, horizontal)
    demands = demands_on((a, b), ahead, pace, walkers, drones, settings, floor=floor)
    planar, kept = not demands.met, True
    if demands.ranks is not None:
        wanted = _wanted(wish, pace, demands, dt)
        safe, kept = nearest(wanted, demands.ranks, horizontal.acceleration)
        a, b = safe
        x = clip(setpoint_for(a, motion.x, dt, horizontal), settings.lowest[0], settings.highest[0])
        y = clip(setpoint_for(b, motion.y, dt, horizontal), settings.lowest[1], settings.highest[1])
    c = asked_by(z, motion.z, dt, vertical)
    upright = not demands.least <= c <= demands.most
    if upright:
        c = clip((wish.velocity[2] - pace[2]) / dt, -wish.acceleration, wish.acceleration)
        kept = kept and demands.least <= demands.most
        # The ceiling and who flies below have the last word: who climbs out of the way can still fall.
        c = min(max(c, demands.least), demands.most)
        z = clip(setpoint_for(c, motion.z, dt, vertical), settings.lowest[2], settings.highest[2])
    told = Motion(tell(x, motion.x, dt), tell(y, motion.y, dt), tell(z, motion.z, dt), motion.age)
    # Of what is demanded beyond what the vehicle can do nobody should be told.
    c = clip(c, -vertical.acceleration, vertical.acceleration)
    return Guarded((x, y, z), told, ahead, pace, (a, b, c), planar=planar, upright=upright, kept=kept)


def _wanted(wish: Wish, pace: Vector, demands: Demands, dt: float) -> Planar:
    """Returns the horizontal acceleration towards the mission's velocity, and aside of what comes."""
    a, b = (wish.velocity[0] - pace[0]) / dt, (wish.velocity[1] - pace[1]) / dt
    size = math.sqrt(a * a + b * b)
    if size > wish.acceleration:
        a, b = a * (wish.acceleration / size), b * (wish.acceleration / size)
    return (a + demands.aside_x, b + demands.aside_y)
