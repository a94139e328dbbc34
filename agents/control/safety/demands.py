"""What is demanded of the next acceleration, by fence, floor, columns and whoever is around.

Horizontally every demand is a half-plane, vertically a bound. What no acceleration of the vehicle could break
is no demand: so almost everybody is passed over after one comparison of distances.
"""

import math
from dataclasses import dataclass
from typing import Final, final

from agents.control.safety.barrier import Curve
from agents.control.safety.encounter import COINCIDENT, STANDSTILL, Berth, Encounter
from agents.control.safety.halfplanes import HalfPlane
from agents.control.safety.response import Response
from agents.control.vectors import Vector

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


@final
class Demands:
    """What is demanded at one moment.

    Attributes:
        planes: Half-planes of horizontal accelerations.
        ranks: The rank of each.
        aside_x: Where to evade to, m/s^2.
        aside_y: The same.
        least: Smallest vertical acceleration, m/s^2.
        most: Largest one.
    """

    def __init__(self) -> None:
        self.planes: list[HalfPlane] = []
        self.ranks: list[int] = []
        self.aside_x = self.aside_y = 0.0
        self.least, self.most = -math.inf, math.inf

    def allow(self, x: float, y: float) -> bool:
        """Says whether a horizontal acceleration meets all of them."""
        return all(plane.x * x + plane.y * y >= plane.least for plane in self.planes)

    def by_rank(self) -> list[list[HalfPlane]]:
        """Returns the half-planes, the most important rank first."""
        found: list[list[HalfPlane]] = [[], [], [], []]
        for i in range(len(self.planes)):
            found[self.ranks[i]].append(self.planes[i])
        return found

    def add(self, rank: int, x: float, y: float, least: float) -> None:
        """Adds a half-plane `x a + y b >= least`."""
        self.planes.append(HalfPlane(x, y, least))
        self.ranks.append(rank)


def demands_on(
    ahead: Vector, pace: Vector, encounters: list[Encounter], settings: SafetySettings, *, floor: bool
) -> Demands:
    """Returns all that is demanded.

    Args:
        ahead: Own point ahead, m.
        pace: Its velocity, m/s.
        encounters: What there is to keep away from, beside columns and fence.
        settings: Vehicle, barriers and bounds.
        floor: Whether the lower bound of the height holds.
    """
    demands = Demands()
    _keep_in(demands, ahead, pace, settings, floor=floor)
    for column in settings.columns:
        if _reaches(column, ahead, pace, settings):
            _keep_off(demands, column, ahead, pace, settings, STATIC)
    for encounter in encounters:
        if _reaches(encounter, ahead, pace, settings):
            _keep_off(demands, encounter, ahead, pace, settings, YIELDING if encounter.yields else UNYIELDING)
    return demands


def _keep_in(demands: Demands, ahead: Vector, pace: Vector, settings: SafetySettings, *, floor: bool) -> None:
    """Adds what fence and floor demand."""
    x, y, z = ahead
    u, v, w = pace
    low_x, low_y, low_z = settings.low
    high_x, high_y, high_z = settings.high
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
    x, y, _ = ahead
    u, v, _ = pace
    dx, dy = x - encounter.x, y - encounter.y
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
