"""Who comes near in a swarm in which not everybody hears everybody: told by neighbours, then heard directly.

A drone hears its ancestors and those that rest near it. A few times a second everybody tells where it saw whom
last, be it heard or told (`Places`), so the word goes round from neighbour to neighbour. Whoever may come near
is then heard directly, and let go of when it is far again: what one drone hears is bounded by how many fit
around it.
"""

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from agents.control.modes import GROUND
from shared.clock import NS_PER_S
from shared.messages import MOST_SEEN, DroneState, Places, Seen, Vector
from shared.nodes import NEAR
from shared.plausibility import BODY_SPEED
from shared.senses import Sensed

AHEAD = 1.0
"""Who will be near within this time is near, s."""
UNSURE = 0.5
"""How much nearer somebody may have come, per second since it was seen, m/s."""
APART = 0.7
"""Who is further away than near by this much is let go of, m."""
LINKED_AFTER = 1.0
"""Who is near and still not heard after this time is missed, s."""
MOST_NEAR = 16
"""So many at most are heard directly beside those that always are."""


class Sighting(NamedTuple):
    """Where somebody was seen last, and when that was (own clock, ns)."""

    seen: Seen
    at_ns: int

    def age(self, now_ns: int) -> float:
        """Returns how long ago that was, s."""
        return (now_ns - self.at_ns) / NS_PER_S


Sightings = Mapping[int, Sighting]


def sighting_of(sensed: Sensed[DroneState]) -> Sighting:
    """Returns a state that was heard as a sighting."""
    state = sensed.message
    seen = Seen(state.id, state.epoch, state.seq, state.position, state.velocity, state.mode, 0.0)
    return Sighting(seen, sensed.arrival_ns)


def hear_places(known: dict[int, Sighting], sensed: Sensed[Places]) -> None:
    """Takes in what somebody tells of others; of each the newest counts.

    What cannot be newer in the time that has passed since is not believed: a body moves at a bounded speed.
    """
    for seen in sensed.message.seen:
        told = Sighting(seen, sensed.arrival_ns - round(seen.age * NS_PER_S))
        before = known.get(seen.id)
        if before is None or (_is_newer(told, before) and _is_possible(told, before)):
            known[seen.id] = told


def _is_newer(told: Sighting, before: Sighting) -> bool:
    return (told.seen.epoch, told.seen.seq) > (before.seen.epoch, before.seen.seq)


def _is_possible(told: Sighting, before: Sighting) -> bool:
    seconds = max(0.0, (told.at_ns - before.at_ns) / NS_PER_S)
    return math.dist(told.seen.position, before.seen.position) <= BODY_SPEED * seconds + NEAR


def newest(
    drones: Iterable[int], heard: Mapping[int, Sensed[DroneState]], told: Sightings
) -> dict[int, Sighting]:
    """Returns the newest of what was heard and told of each drone, as far as anything is known."""
    found = {}
    for drone in drones:
        own = heard.get(drone)
        best = told.get(drone)
        if own is not None:
            direct = sighting_of(own)
            if best is None or not _is_newer(best, direct):
                best = direct
        if best is not None:
            found[drone] = best
    return found


def tell(own: Seen, sightings: Sightings, now_ns: int) -> tuple[Seen, ...]:
    """Returns what a drone tells of itself and of the others, the nearest of many."""
    others = [each.seen._replace(age=each.age(now_ns)) for each in sightings.values()]
    others.sort(key=lambda seen: math.dist(seen.position, own.position))
    return (own, *others[: MOST_SEEN - 1])


class Vicinity:
    """What one drone knows of those whom it does not always hear, and whom of them it is to hear now.

    Args:
        drone: Own number.
        always: Whom it always hears.
        others: Everybody else.

    Attributes:
        near: Whom it is to hear directly beside those that it always hears.
    """

    def __init__(self, drone: int, always: Iterable[int], others: Iterable[int]) -> None:
        self.near: frozenset[int] = frozenset()
        self._drone = drone
        self._always = frozenset(always)
        self._others = frozenset(others) - self._always - {drone}
        self._told: dict[int, Sighting] = {}
        self._near_since_ns: dict[int, int] = {}

    def hear(self, places: Iterable[Sensed[Places]]) -> None:
        """Takes in what was told."""
        for sensed in places:
            hear_places(self._told, sensed)

    def look(
        self, position: Vector, velocity: Vector, heard: Mapping[int, Sensed[DroneState]], now_ns: int
    ) -> None:
        """Decides anew whom to hear directly."""
        sightings = newest(self._others, heard, self._told)
        flying = {drone: each for drone, each in sightings.items() if each.seen.mode is not GROUND}
        self.near = who_comes_near(position, velocity, flying, self.near, now_ns)
        since = self._near_since_ns
        self._near_since_ns = {drone: since.get(drone, now_ns) for drone in self.near}

    def tell(self, own: Seen, heard: Mapping[int, Sensed[DroneState]], now_ns: int) -> tuple[Seen, ...]:
        """Returns what to tell of itself and of everybody else."""
        return tell(own, newest(self._others | self._always, heard, self._told), now_ns)

    def counted(self, heard: Mapping[int, Sensed[DroneState]], now_ns: int) -> list[int]:
        """Returns who of those that are near is to be heard by now: a link takes its time."""
        patience_ns = round(LINKED_AFTER * NS_PER_S)
        return [
            drone
            for drone, since_ns in self._near_since_ns.items()
            if now_ns - since_ns > patience_ns or (drone in heard and heard[drone].arrival_ns >= since_ns)
        ]

    def told_of(self, drones: Iterable[int], now_ns: int) -> list[Seen]:
        """Returns where some drones were seen last, as far as it was told."""
        found = [self._told[drone] for drone in drones if drone in self._told]
        return [each.seen._replace(age=max(0.0, each.age(now_ns))) for each in found]


def who_comes_near(
    position: Vector, velocity: Vector, sightings: Sightings, before: frozenset[int], now_ns: int
) -> frozenset[int]:
    """Returns whom to hear directly.

    Args:
        position: Own, m.
        velocity: Own, m/s.
        sightings: Of those who are not heard anyway.
        before: Whom it hears directly so far.
        now_ns: Own clock.
    """
    gaps = {}
    for drone, sighting in sightings.items():
        gap = _gap(position, velocity, sighting, now_ns)
        if gap < NEAR + (APART if drone in before else 0.0):
            gaps[drone] = gap
    return frozenset(sorted(gaps, key=gaps.__getitem__)[:MOST_NEAR])


def _gap(position: Vector, velocity: Vector, sighting: Sighting, now_ns: int) -> float:
    """Returns how near somebody may come soon, horizontally, m."""
    x, y = (a - b for a, b in zip(sighting.seen.position[:2], position[:2], strict=True))
    u, v = (a - b for a, b in zip(sighting.seen.velocity[:2], velocity[:2], strict=True))
    distance = math.hypot(x, y)
    closing = -(x * u + y * v) / distance if distance > 0.0 else 0.0
    return distance - max(closing, 0.0) * AHEAD - UNSURE * sighting.age(now_ns)
