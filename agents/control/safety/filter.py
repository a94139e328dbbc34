"""The filter: what the mission wants if that is safe, else the nearest acceleration that is.

Horizontally all demands are half-planes of accelerations, and `halfplanes.nearest` takes the nearest one
inside all of them. Vertically they are an interval. Where nothing demands anything, the mission's set-point
goes through as it is. Where it is refused, what the mission wants is its velocity, within its limit of
acceleration: the set-point lies ahead of the body for the sake of the vehicle's lag, and tells no haste.
"""

import math
from typing import Final, final

from agents.control.safety.barrier import Curve
from agents.control.safety.encounter import COINCIDENT, STANDSTILL, Berth, Encounter
from agents.control.safety.halfplanes import HalfPlane, nearest
from agents.control.safety.response import (
    LONGEST_LOOK,
    Axis,
    Response,
    asked_by,
    observe,
    setpoint_for,
    start_axis,
    tell,
)
from agents.control.vectors import Planar, Vector

STATIC: Final = 0
UNYIELDING: Final = 1
YIELDING: Final = 2
COMFORT: Final = 3
"""Ranks of demands: who must never be touched comes first."""


@final
class Motion:
    """What is known about the own body.

    Attributes:
        x: Axis.
        y: The same.
        z: The same.
        age: Of the pose, s.
    """

    __slots__ = ("age", "x", "y", "z")

    def __init__(self, x: Axis, y: Axis, z: Axis, age: float) -> None:
        self.x: Final = x
        self.y: Final = y
        self.z: Final = z
        self.age: Final = age


@final
class SafetySettings:
    """What the filter needs to know of vehicle and scenario.

    Attributes:
        horizontal: How the vehicle answers.
        vertical: The same.
        planar: Barrier of everything horizontal.
        upright: Barrier of everything vertical.
        low: Where the point ahead may be, m; its height bounds those modes that have a floor.
        high: The same.
        lowest: Where a set-point may be, m.
        highest: The same.
        columns: Static obstacles.
        hand: How far to keep from one.
        over: How far to stay above what stands, m.
    """

    __slots__ = (
        "columns",
        "hand",
        "high",
        "highest",
        "horizontal",
        "low",
        "lowest",
        "over",
        "planar",
        "upright",
        "vertical",
    )

    def __init__(
        self,
        *,
        horizontal: Response,
        vertical: Response,
        planar: Curve,
        upright: Curve,
        low: Vector,
        high: Vector,
        lowest: Vector,
        highest: Vector,
        columns: list[Encounter],
        hand: Berth,
        over: float,
    ) -> None:
        self.horizontal: Final = horizontal
        self.vertical: Final = vertical
        self.planar: Final = planar
        self.upright: Final = upright
        self.low: Final = low
        self.high: Final = high
        self.lowest: Final = lowest
        self.highest: Final = highest
        self.columns: Final = columns
        self.hand: Final = hand
        self.over: Final = over


@final
class Wish:
    """What the mission wants.

    Attributes:
        setpoint: m.
        velocity: m/s.
        acceleration: How hard it may accelerate towards that velocity, m/s^2.
    """

    __slots__ = ("acceleration", "setpoint", "velocity")

    def __init__(self, setpoint: Vector, velocity: Vector, acceleration: float) -> None:
        self.setpoint: Final = setpoint
        self.velocity: Final = velocity
        self.acceleration: Final = acceleration


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

    __slots__ = ("ahead", "asked", "kept", "motion", "pace", "planar", "setpoint", "upright")

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


@final
class Demands:
    """What is demanded at one moment.

    Attributes:
        ranks: Half-planes of horizontal accelerations.
        aside_x: Where to evade to, m/s^2.
        aside_y: The same.
        least: Smallest vertical acceleration, m/s^2.
        most: Largest one.
    """

    __slots__ = ("aside_x", "aside_y", "least", "most", "ranks")

    def __init__(self) -> None:
        self.ranks: list[list[HalfPlane]] = [[], [], [], []]
        self.aside_x = self.aside_y = 0.0
        self.least, self.most = -math.inf, math.inf

    def allow(self, x: float, y: float) -> bool:
        """Says whether a horizontal acceleration meets all of them."""
        for rank in self.ranks:
            for plane in rank:
                if plane.lack((x, y)) > 0.0:
                    return False
        return True


def start_motion(position: Vector, velocity: Vector, age: float) -> Motion:
    """Returns what is known of a body that has not been told anything."""
    x, y, z = position
    u, v, w = velocity
    return Motion(start_axis(x, u), start_axis(y, v), start_axis(z, w), age)


def watch(
    motion: Motion, position: Vector, velocity: Vector, age: float, dt: float, settings: SafetySettings
) -> Motion:
    """Takes in a pose.

    Args:
        motion: After the last step.
        position: m.
        velocity: m/s.
        age: Of the pose, s.
        dt: Time since the last step, s.
        settings: How the vehicle answers.
    """
    x, y, z = position
    u, v, w = velocity
    between = dt + motion.age - age
    horizontal, vertical = settings.horizontal, settings.vertical
    return Motion(
        observe(motion.x, x, u, between, horizontal),
        observe(motion.y, y, v, between, horizontal),
        observe(motion.z, z, w, between, vertical),
        age,
    )


def guard(
    wish: Wish, motion: Motion, encounters: list[Encounter], settings: SafetySettings, dt: float, *, floor: bool
) -> Guarded:
    """Decides what the vehicle is told.

    Args:
        wish: What the mission wants.
        motion: The own body.
        encounters: What there is to keep away from, beside columns and fence.
        settings: Vehicle, barriers and bounds.
        dt: Time since the last step, s.
        floor: Whether the lower bound of the height holds: not while taking off or landing.
    """
    ahead, pace = point_ahead(motion, settings)
    demands = _demands(ahead, pace, encounters, settings, floor=floor)
    x, y, z = wish.setpoint
    a, b = asked_by(x, motion.x, dt, settings.horizontal), asked_by(y, motion.y, dt, settings.horizontal)
    planar, kept = not demands.allow(a, b), True
    if planar:
        wanted = _wanted(wish, pace, demands, dt)
        safe, kept = nearest(wanted, demands.ranks, settings.horizontal.acceleration)
        a, b = safe
        x = _clip(setpoint_for(a, motion.x, dt, settings.horizontal), settings.lowest[0], settings.highest[0])
        y = _clip(setpoint_for(b, motion.y, dt, settings.horizontal), settings.lowest[1], settings.highest[1])
    c = asked_by(z, motion.z, dt, settings.vertical)
    upright = not demands.least <= c <= demands.most
    if upright:
        c = _clip((wish.velocity[2] - pace[2]) / dt, -wish.acceleration, wish.acceleration)
        kept = kept and demands.least <= demands.most
        # The ceiling and who flies below have the last word: who climbs out of the way can still fall.
        c = min(max(c, demands.least), demands.most)
        z = _clip(setpoint_for(c, motion.z, dt, settings.vertical), settings.lowest[2], settings.highest[2])
    told = Motion(tell(x, motion.x, dt), tell(y, motion.y, dt), tell(z, motion.z, dt), motion.age)
    return Guarded((x, y, z), told, ahead, pace, (a, b, c), planar=planar, upright=upright, kept=kept)


def point_ahead(motion: Motion, settings: SafetySettings) -> tuple[Vector, Vector]:
    """Returns where the body will be once it has answered, now and not when the pose was measured."""
    x, y, z, age = motion.x, motion.y, motion.z, min(motion.age, LONGEST_LOOK)
    across, up = settings.horizontal.lag + age, settings.vertical.lag + age
    ahead = (x.position + across * x.velocity, y.position + across * y.velocity, z.position + up * z.velocity)
    pace = (x.velocity + across * x.actual, y.velocity + across * y.actual, z.velocity + up * z.actual)
    return ahead, pace


def _wanted(wish: Wish, pace: Vector, demands: Demands, dt: float) -> Planar:
    """Returns the horizontal acceleration towards the mission's velocity, and aside of what comes."""
    a, b = (wish.velocity[0] - pace[0]) / dt, (wish.velocity[1] - pace[1]) / dt
    size = math.sqrt(a * a + b * b)
    if size > wish.acceleration:
        a, b = a * (wish.acceleration / size), b * (wish.acceleration / size)
    return (a + demands.aside_x, b + demands.aside_y)


def _demands(
    ahead: Vector, pace: Vector, encounters: list[Encounter], settings: SafetySettings, *, floor: bool
) -> Demands:
    demands = Demands()
    _keep_in(demands, ahead, pace, settings, floor=floor)
    for column in settings.columns:
        _keep_off(demands, column, ahead, pace, settings, STATIC)
    for encounter in encounters:
        _keep_off(demands, encounter, ahead, pace, settings, YIELDING if encounter.yields else UNYIELDING)
    return demands


def _keep_in(demands: Demands, ahead: Vector, pace: Vector, settings: SafetySettings, *, floor: bool) -> None:
    """Adds what the fence demands."""
    x, y, z = ahead
    u, v, w = pace
    curve, low, high = settings.planar, settings.low, settings.high
    _add(demands, STATIC, 1.0, 0.0, curve.demand(x - low[0], -u), settings)
    _add(demands, STATIC, -1.0, 0.0, curve.demand(high[0] - x, u), settings)
    _add(demands, STATIC, 0.0, 1.0, curve.demand(y - low[1], -v), settings)
    _add(demands, STATIC, 0.0, -1.0, curve.demand(high[1] - y, v), settings)
    if floor:
        demands.least = max(demands.least, settings.upright.demand(z - low[2], -w))
    demands.most = min(demands.most, -settings.upright.demand(high[2] - z, w))


def _add(demands: Demands, rank: int, x: float, y: float, demand: float, settings: SafetySettings) -> None:
    """Adds a half-plane, unless no acceleration that can be asked for is outside."""
    if demand > -settings.horizontal.acceleration:
        demands.ranks[rank].append(HalfPlane(x, y, demand))


def _keep_off(
    demands: Demands,
    encounter: Encounter,
    ahead: Vector,
    pace: Vector,
    settings: SafetySettings,
    rank: int,
) -> None:
    """Adds what one encounter demands: horizontally, or vertically where that is the nearer way around it."""
    x, y, z = ahead
    u, v, w = pace
    dx, dy = x - encounter.x, y - encounter.y
    du, dv = u - encounter.u, v - encounter.v
    tx, ty = encounter.trail
    if tx != 0.0 or ty != 0.0:
        share = min(max((dx * tx + dy * ty) / (tx * tx + ty * ty), 0.0), 1.0)
        dx, dy = dx - share * tx, dy - share * ty
        if share < 1.0:
            # Only its far end moves on.
            du, dv = u, v
    distance = math.sqrt(dx * dx + dy * dy)
    hx, hy = 1.0, 0.0
    if distance > COINCIDENT:
        hx, hy = dx / distance, dy / distance
    closing = encounter.surprise - (hx * du + hy * dv)
    gap = distance - encounter.distance
    over = z - encounter.z - encounter.above
    under = encounter.z - z - encounter.below
    if over > 0.0 or under > 0.0:
        level, closing_in = (over, encounter.w - w) if over > 0.0 else (under, w - encounter.w)
        if gap <= 0.0 or settings.upright.pace(level) - closing_in > settings.planar.pace(gap) - closing:
            demand = settings.upright.demand(level, closing_in)
            if over > 0.0:
                demands.least = max(demands.least, demand)
            else:
                demands.most = min(demands.most, -demand)
            return
    demand = settings.planar.demand(gap, closing)
    # Who runs away itself need not be left as fast.
    _add(demands, rank, hx, hy, demand + min(hx * encounter.asked[0] + hy * encounter.asked[1], 0.0), settings)
    if encounter.comfort > 0.0:
        demand = settings.planar.demand(gap - encounter.comfort, closing)
        _add(demands, COMFORT, hx, hy, demand, settings)
    if demand > 0.0 and encounter.slip > 0.0 and closing > STANDSTILL:
        # To the left if it comes right on.
        side = encounter.slip * min(demand, settings.horizontal.acceleration)
        side = -side if hx * dv - hy * du < 0.0 else side
        demands.aside_x, demands.aside_y = demands.aside_x - side * hy, demands.aside_y + side * hx


def _clip(value: float, low: float, high: float) -> float:
    return low if value < low else high if value > high else value
