"""Whether a body could have got out of the way of a hand at all. Pure.

Nothing bounds how fast a hand sets out, so no law keeps every distance from every hand (docs/safety.md). Who is
asked for the impossible is not judged, by one rule: from the moment when the hand set out towards it, the body
is flown again as an ideal one that knows where to go, in 16 directions: after its reaction time it accelerates
as hard as barriers count on. If none of these flights keeps the distance, off the columns, nobody could have.
"""

import math

import numpy as np
from attrs import frozen

from agents.vehicles.world.referee import Rules
from shared.arrays import Mask, Vec, stretches
from shared.envelope import REACTION, AxisEnvelope

SETS_OUT = 0.05
"""A hand that comes nearer more slowly than this rests, m/s."""
DIRECTIONS = 16
FASTEST = 1.5
"""The ideal body flees no faster than the hands that are drawn, m/s."""


@frozen(kw_only=True, eq=False)
class Chase:
    """One body, and the hand.

    Attributes:
        t: (T,) s.
        hand: (T, 3) m.
        body: (T, 3) m.
        vehicle: Its horizontal axes.
        rules: Fence and columns.
    """

    t: Vec
    hand: Vec
    body: Vec
    vehicle: AxisEnvelope
    rules: Rules


def beyond_help(chase: Chase, near: Mask, keep: float) -> Mask:
    """Returns in which ticks a body is too near to a hand that it could not have fled from.

    Args:
        chase: Body and hand.
        near: (T,) where it is nearer than it should be.
        keep: That distance, m.
    """
    found = np.zeros_like(near)
    for ticks in stretches(near):
        first: int = ticks.start
        start = _set_out(chase, first)
        apart = np.linalg.norm(chase.body[ticks] - chase.hand[ticks], axis=1)
        closest = first + int(np.argmin(apart)) + 1
        if start < first and not _could_flee(chase, start, closest, keep):
            found[ticks] = True
    return found


def _set_out(chase: Chase, tick: int) -> int:
    """Returns the last tick up to the given one at which the hand did not come nearer by its own motion."""
    if tick == 0:
        return 0
    velocity = np.diff(chase.hand[: tick + 1], axis=0) / np.diff(chase.t[: tick + 1])[:, None]
    gap = chase.body[:tick] - chase.hand[:tick]
    approach = (velocity * gap).sum(axis=1) / np.maximum(np.linalg.norm(gap, axis=1), 1e-9)
    calm = np.flatnonzero(approach <= SETS_OUT)
    return int(calm[-1]) + 1 if calm.size else 0


def _could_flee(chase: Chase, start: int, end: int, keep: float) -> bool:
    """Says whether one of the ideal flights keeps its distance from the hand until a tick."""
    vehicle, rules = chase.vehicle, chase.rules
    passed = chase.t[start:end] - chase.t[start]
    before = max(start - 1, 0)
    moved = (chase.body[start] - chase.body[before])[:2]
    velocity = moved / (chase.t[start] - chase.t[before]) if start > before else moved
    fleeing = np.maximum(passed - REACTION - vehicle.lag, 0.0)
    speeding = np.minimum(fleeing, FASTEST / vehicle.brake)
    way = 0.5 * vehicle.brake * speeding**2 + FASTEST * (fleeing - speeding)
    low, high = (np.array(corner[:2]) for corner in rules.fence)
    for heading in np.linspace(0.0, math.tau, DIRECTIONS, endpoint=False):
        away = np.array([math.cos(heading), math.sin(heading)])
        place = np.clip(chase.body[start, :2] + passed[:, None] * velocity + way[:, None] * away, low, high)
        aside = np.linalg.norm(place - chase.hand[start:end, :2], axis=1)
        distance = np.hypot(aside, chase.body[start:end, 2] - chase.hand[start:end, 2])
        if distance.min() >= keep and _clear(place, rules):
            return True
    return False


def _clear(place: Vec, rules: Rules) -> bool:
    return all(
        bool((np.hypot(place[:, 0] - column.x, place[:, 1] - column.y) >= column.radius).all())
        for column in rules.columns
    )
