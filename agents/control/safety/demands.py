"""What is demanded of the next acceleration, by fence, floor, columns and whoever is around.

Horizontally every demand is a half-plane, vertically a bound. What no acceleration of the vehicle could break
is no demand: so almost everybody is passed over after one comparison of distances.
"""

import math
from dataclasses import dataclass
from typing import Final, final

from mypy_extensions import mypyc_attr

from agents.control.safety.barrier import Curve
from agents.control.safety.encounter import COINCIDENT, STANDSTILL, Berth, Encounter
from agents.control.safety.halfplanes import HalfPlane
from agents.control.safety.response import Response
from agents.control.vectors import Planar, Vector

STATIC: Final = 0
UNYIELDING: Final = 1
YIELDING: Final = 2
COMFORT: Final = 3
"""Ranks of demands: who must never be touched comes first."""


@final
@dataclass(frozen=True, kw_only=True)
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

    horizontal: Response
    vertical: Response
    planar: Curve
    upright: Curve
    low: Vector
    high: Vector
    lowest: Vector
    highest: Vector
    columns: list[Encounter]
    hand: Berth
    over: float


@mypyc_attr(acyclic=True, free_list_len=1)
@final
class Demands:
    """What is demanded at one moment.

    Args:
        asked_x: Horizontal acceleration that is asked for, m/s^2.
        asked_y: The same.
        ranks: Where half-planes are put, by rank; None: all that counts is whether that meets them.

    Attributes:
        ranks: Half-planes of horizontal accelerations, the most important rank first.
        met: Whether what is asked for meets all of them.
        aside_x: Where to evade to, m/s^2.
        aside_y: The same.
        least: Smallest vertical acceleration, m/s^2.
        most: Largest one.
    """

    def __init__(self, asked_x: float, asked_y: float, ranks: list[list[HalfPlane]] | None) -> None:
        self.asked_x: Final = asked_x
        self.asked_y: Final = asked_y
        self.ranks: Final = ranks
        self.met = True
        self.aside_x = self.aside_y = 0.0
        self.least, self.most = -math.inf, math.inf

    def add(self, rank: int, x: float, y: float, least: float) -> None:
        """Adds a half-plane `x a + y b >= least`."""
        self.met = self.met and x * self.asked_x + y * self.asked_y >= least
        if self.ranks is not None:
            self.ranks[rank].append(HalfPlane(x, y, least))


def demands_on(
    asked: Planar,
    ahead: Vector,
    pace: Vector,
    walkers: list[Encounter],
    drones: list[Encounter],
    settings: SafetySettings,
    *,
    floor: bool,
) -> Demands:
    """Returns what is demanded; half-planes only where what is asked for does not meet all of them.

    Args:
        asked: Horizontal acceleration that is asked for, m/s^2.
        ahead: Own point ahead, m.
        pace: Its velocity, m/s.
        walkers: What there is to keep away from, beside columns and fence.
        drones: The same.
        settings: Vehicle, barriers and bounds.
        floor: Whether the lower bound of the height holds.
    """
    x, y = asked
    demands = Demands(x, y, None)
    _demand(demands, ahead, pace, walkers, drones, settings, floor=floor)
    if not demands.met:
        # Mostly all are met, and computing them again is cheaper than always making objects of them.
        demands = Demands(x, y, [[], [], [], []])
        _demand(demands, ahead, pace, walkers, drones, settings, floor=floor)
    return demands


def _demand(
    demands: Demands,
    ahead: Vector,
    pace: Vector,
    walkers: list[Encounter],
    drones: list[Encounter],
    settings: SafetySettings,
    *,
    floor: bool,
) -> None:
    """Adds all that is demanded."""
    _keep_in(demands, ahead, pace, settings, floor=floor)
    _keep_off_all(demands, settings.columns, ahead, pace, settings, STATIC)
    _keep_off_all(demands, walkers, ahead, pace, settings, UNYIELDING)
    _keep_off_all(demands, drones, ahead, pace, settings, UNYIELDING)


def _keep_off_all(
    demands: Demands,
    encounters: list[Encounter],
    ahead: Vector,
    pace: Vector,
    settings: SafetySettings,
    rank: int,
) -> None:
    """Adds what encounters demand; those that do not yield are of a rank."""
    for encounter in encounters:
        if _reaches(encounter, ahead, pace, settings):
            _keep_off(demands, encounter, ahead, pace, settings, YIELDING if encounter.yields else rank)


def _keep_in(demands: Demands, ahead: Vector, pace: Vector, settings: SafetySettings, *, floor: bool) -> None:
    """Adds what fence and floor demand."""
    x, y, z = ahead
    u, v, w = pace
    low_x, low_y, low_z = settings.low
    high_x, high_y, high_z = settings.high
    # One comparison for all four walls, which mostly are far away: a reach grows with the speed.
    reach = settings.planar.reach(abs(u) + abs(v), settings.horizontal.acceleration)
    if not (x - low_x >= reach and high_x - x >= reach and y - low_y >= reach and high_y - y >= reach):
        _between(demands, x - low_x, high_x - x, u, 1.0, 0.0, settings)
        _between(demands, y - low_y, high_y - y, v, 0.0, 1.0, settings)
    curve = settings.upright
    reach = curve.reach(abs(w), settings.vertical.acceleration)
    if floor and z - low_z < reach:
        demands.least = curve.demand(z - low_z, -w)
    if high_z - z < reach:
        demands.most = -curve.demand(high_z - z, w)


def _between(
    demands: Demands, after: float, before: float, speed: float, x: float, y: float, settings: SafetySettings
) -> None:
    """Adds what two opposite walls demand, from the gaps to them along (x, y) and the speed along that."""
    curve = settings.planar
    reach = curve.reach(abs(speed), settings.horizontal.acceleration)
    if after < reach:
        demands.add(STATIC, x, y, curve.demand(after, -speed))
    if before < reach:
        demands.add(STATIC, -x, -y, curve.demand(before, speed))


def _reaches(encounter: Encounter, ahead: Vector, pace: Vector, settings: SafetySettings) -> bool:
    """Says whether an encounter is near enough, and fast enough, to demand anything; never no too much."""
    u, v = pace[0], pace[1]
    dx, dy = ahead[0] - encounter.x, ahead[1] - encounter.y
    closing = encounter.surprise + abs(u - encounter.u) + abs(v - encounter.v)
    tx, ty = encounter.trail
    trail = abs(tx) + abs(ty)
    if trail > 0.0:
        closing += abs(u) + abs(v)
    brake = settings.planar.reach(closing, settings.horizontal.acceleration)
    reach = encounter.distance + encounter.comfort + trail + brake
    return dx * dx + dy * dy < reach * reach


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
    p, q = encounter.asked
    demands.add(rank, hx, hy, demand + min(hx * p + hy * q, 0.0))
    if encounter.comfort > 0.0:
        demands.add(COMFORT, hx, hy, settings.planar.demand(gap - encounter.comfort, closing))
    if demand > 0.0 and encounter.slip > 0.0 and closing > STANDSTILL:
        # To the left if it comes right on.
        side = encounter.slip * min(demand, settings.horizontal.acceleration)
        side = -side if hx * dv - hy * du < 0.0 else side
        demands.aside_x, demands.aside_y = demands.aside_x - side * hy, demands.aside_y + side * hx
