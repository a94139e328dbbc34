"""What there is to keep away from: what is known of it, and how far that may be from what is."""

import math
from dataclasses import dataclass
from typing import Final, final

from agents.control.vectors import ORIGIN, Planar, Vector
from shared.cells import Place

COINCIDENT: Final = 1e-9
"""Nearer than this there is no direction away from something: one leaves along +x, m."""
STANDSTILL: Final = 0.05
"""Below this closing speed there is no line of approach, m/s."""
DELAY: Final = 0.05
"""What is heard may have been under way for this long, s."""
SILENT_AFTER: Final = 0.1
"""A drone unheard for this long no longer keeps away from anybody, and may be elsewhere, s."""
COASTING: Final = 2.5
"""A body that nobody flies may coast for this long, s: level for 1.5 s, then a fall of a second at most."""
DRIFT: Final = 0.2
"""How fast the place where a silent body may be grows, m/s ..."""
DRIFTED: Final = 0.3
"""... up to this, m."""
DRONE_SLIP: Final = 0.2
"""Two drones that come right at each other pass on the right."""
SILENT_SLIP: Final = 0.3
HAND_SURPRISE: Final = 2.0
"""How much the velocity of a hand may change while nothing is heard of it, m/s^2."""
HAND_SLIP: Final = 0.2
"""Who is right in the way of a hand would else be pushed along in front of it."""


@final
class Encounter(Place):
    """Something to keep away from: a drone, a hand, an obstacle, a column.

    It fills a cylinder about a vertical axis. One that is not heard may be anywhere along a trail.

    Attributes:
        x: Its point ahead (`agents.control.safety.response`), m.
        y: The same.
        z: The same.
        u: Its pace, the velocity of that point, m/s.
        v: The same.
        w: The same.
        asked: Acceleration of that point, as it says, m/s^2.
        distance: Smallest horizontal distance of the two points ahead, m.
        comfort: Wished for beyond that, where nothing else is in the way, m.
        surprise: How much faster than its pace it may come by now, m/s.
        above: How far above its centre it reaches, m.
        below: How far below it, m.
        yields: Whether it keeps away from us as we do from it.
        slip: Share of evading that leads aside, off its line of approach.
        trail: From its point to the other end of where it may be, m.
    """

    def __init__(
        self,
        point: Vector,
        pace: Vector,
        distance: float,
        *,
        comfort: float = 0.0,
        surprise: float = 0.0,
        above: float = math.inf,
        below: float = math.inf,
        yields: bool = False,
        slip: float = 0.0,
        trail: Planar = (0.0, 0.0),
        asked: Planar = (0.0, 0.0),
    ) -> None:
        super().__init__(point[0], point[1])
        self.z: Final = point[2]
        self.u: Final = pace[0]
        self.v: Final = pace[1]
        self.w: Final = pace[2]
        self.distance: Final = distance
        self.comfort: Final = comfort
        self.surprise: Final = surprise
        self.above: Final = above
        self.below: Final = below
        self.yields: Final = yields
        self.slip: Final = slip
        self.trail: Final = trail
        self.asked: Final = asked


@final
@dataclass(frozen=True)
class Clearance:
    """How far one drone keeps from another.

    Attributes:
        distance: Horizontally, m.
        height: Vertically, where it is nearer than that, m: the air below a drone carries nobody.
        surprise: How much its velocity may change while nothing is heard of it, m/s^2.
    """

    distance: float
    height: float
    surprise: float


@final
@dataclass(frozen=True)
class Berth:
    """How far to keep from what does not yield.

    Attributes:
        distance: Horizontally, m.
        comfort: Wished for beyond that, m.
    """

    distance: float
    comfort: float


def drone_heard(
    ahead: Vector, pace: Vector, asked: Vector, age: float, clearance: Clearance, *, yields: bool
) -> Encounter:
    """Returns a drone that is heard.

    Args:
        ahead: Its point ahead when it said so, m.
        pace: Velocity of that, m/s.
        asked: What its vehicle was asked for, m/s^2.
        age: How long ago it was heard, s.
        clearance: How far to keep from it.
        yields: Whether it hears us and flies.
    """
    x, y, z = ahead
    u, v, w = pace
    return Encounter(
        (x + age * u, y + age * v, z + age * w),
        pace,
        clearance.distance,
        surprise=clearance.surprise * (age + DELAY),
        above=clearance.height,
        below=clearance.height,
        yields=yields,
        slip=DRONE_SLIP,
        asked=(asked[0], asked[1]),
    )


def drone_silent(position: Vector, velocity: Vector, age: float, clearance: Clearance, lag: float) -> Encounter:
    """Returns a drone that is not heard: anywhere from where it was last to where it would be, at any height.

    Args:
        position: Where it was last, m.
        velocity: How it moved then, m/s.
        age: How long ago, s.
        clearance: How far to keep from it.
        lag: Of the own vehicle, s: what is now there will have moved on when it has answered.
    """
    u, v, w = velocity
    coasted = min(age, COASTING)
    if age >= COASTING:
        u = v = 0.0
    return Encounter(
        position,
        (u, v, w),
        clearance.distance,
        comfort=min(DRIFT * age, DRIFTED),
        slip=SILENT_SLIP,
        trail=((coasted + lag) * velocity[0], (coasted + lag) * velocity[1]),
    )


def walker_seen(
    position: Vector,
    velocity: Vector,
    age: float,
    lag: float,
    berth: Berth,
    *,
    radius: float = 0.0,
    above: float = math.inf,
    below: float = math.inf,
) -> Encounter:
    """Returns a hand, or whoever else walks about without looking; unheard, it may be anywhere on its way.

    Args:
        position: m.
        velocity: m/s.
        age: How long ago it was heard, s.
        lag: Of the own vehicle, s.
        berth: How far to keep from its surface.
        radius: m.
        above: At what height above its position one passes over it, m; a hand has somebody standing below.
        below: How far below its position one passes under it, m.
    """
    x, y, z = position
    way_x, way_y = (age + lag) * velocity[0], (age + lag) * velocity[1]
    trail = (way_x, way_y)
    if age <= SILENT_AFTER:
        x, y, trail = x + way_x, y + way_y, (0.0, 0.0)
    return Encounter(
        (x, y, z),
        velocity,
        radius + berth.distance,
        comfort=berth.comfort,
        surprise=HAND_SURPRISE * DELAY,
        above=above,
        below=below,
        slip=HAND_SLIP,
        trail=trail,
    )


def column_at(x: float, y: float, distance: float, height: float) -> Encounter:
    """Returns a column.

    Args:
        x: Its axis, m.
        y: The same.
        distance: How far to keep from it, m.
        height: At what height one passes above it, m.
    """
    return Encounter((x, y, 0.0), ORIGIN, distance, above=height)
