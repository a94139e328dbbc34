"""Walkers of a scenario: where each is at a time. Pure."""

import itertools
import math
from collections.abc import Iterable

from shared.clock import NS_PER_S
from shared.messages import ORIGIN, ObstacleState, Vector
from shared.scenario import Walker
from shared.stroke import MINIMUM_JERK_PEAK, minimum_jerk, minimum_jerk_rate
from shared.topics import OBSTACLE

VALID_S = 2.0
"""How long a walker may be relied on to be about where it was said to be, s."""


def walk(walker: Walker, t: float) -> tuple[Vector, Vector]:
    """Returns where a walker is, m, and how it moves, m/s, at a time in s.

    From corner to corner in minimum-jerk strokes, there and back again; before its start it stands.
    """
    there_and_back = [*walker.path, *walker.path[-2::-1]]
    legs = [(a, b, _duration(a, b, walker.speed)) for a, b in itertools.pairwise(there_and_back)]
    round_s = sum(duration for _, _, duration in legs)
    left = (t - walker.start) % round_s if t > walker.start and round_s > 0.0 else 0.0
    for (x, y), (a, b), duration in legs:
        if left <= duration:
            share = left / duration if duration > 0.0 else 0.0
            place = minimum_jerk(share)
            rate = minimum_jerk_rate(share) / duration if duration > 0.0 else 0.0
            position = (x + place * (a - x), y + place * (b - y), 0.0)
            return position, (rate * (a - x), rate * (b - y), 0.0)
        left -= duration
    x, y = walker.path[0]
    return (x, y, 0.0), ORIGIN


def _duration(start: tuple[float, float], end: tuple[float, float], peak: float) -> float:
    return MINIMUM_JERK_PEAK * math.dist(start, end) / peak


def obstacles_at(
    walkers: Iterable[Walker], t: float, *, epoch: int, seq: int, stamp_ns: int
) -> list[ObstacleState]:
    """Returns what the world says of its walkers, numbered from 1.

    Args:
        walkers: In the order of the scenario.
        t: Time since the start, s.
        epoch: Start of the process, ns.
        seq: Number of this report.
        stamp_ns: Clock of the process.
    """
    states = []
    for number, walker in enumerate(walkers, start=1):
        position, velocity = walk(walker, t)
        states.append(
            ObstacleState(
                epoch=epoch,
                seq=seq,
                stamp_ns=stamp_ns,
                id=number,
                position=position,
                velocity=velocity,
                radius=walker.radius,
                height=walker.height,
                valid_s=VALID_S,
            )
        )
    return states


PERIOD_NS = round(NS_PER_S / OBSTACLE.rate_hz)
