"""Who comes near in a swarm in which not everybody hears everybody: told by others, then heard directly.

A drone hears its ancestors and those that rest near it. A few times a second everybody tells where it knows
whom (`Places`), be it heard or told, so the word goes round from drone to drone (`shared.nodes.tellers`).
Whoever may come near is then heard directly, and let go of when it is far again: what one drone hears is
bounded by how many fit around it. Pure: time is passed in.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Final, NamedTuple, final

from agents.company import Memory, may_fly, seen_of
from shared.clock import NS_PER_S
from shared.messages import MOST_SEEN, DroneState, Places, Seen
from shared.nodes import NEAR
from shared.senses import Sensed
from shared.topics import DRONE_STATE, PLACES

AHEAD: Final = 1.0
"""Who will be near within this time is near, s."""
UNSURE: Final = 0.5
"""How much nearer somebody may have come, per second since it was seen, m/s."""
APART: Final = 0.7
"""Who is further away than near by this much is let go of, m."""
LINKED_AFTER: Final = 1.0
"""Who is near and still not heard after this time is missed, s."""
MOST_NEAR: Final = 16
"""So many at most are heard directly beside those that always are."""

_LINKED_AFTER_NS: Final = round(LINKED_AFTER * NS_PER_S)

Heard = Mapping[int, Sensed[DroneState]]
Told = Mapping[int, Sensed[Places]]


class Sighting(NamedTuple):
    """Where somebody was seen last, and when that was (own clock, ns)."""

    seen: Seen
    at_ns: int

    def now(self, now_ns: int) -> Seen:
        """Returns it with the age that it has now."""
        return self.seen._replace(age=max(0.0, (now_ns - self.at_ns) / NS_PER_S))


@final
class Vicinity:
    """What one drone knows of those whom it does not always hear, and whom of them it is to hear now.

    Args:
        always: Whom it always hears.
        memories: How long the body of each of all others may stay in the air without being heard.

    Attributes:
        near: Whom it is to hear directly beside those that it always hears.
    """

    def __init__(self, always: Iterable[int], memories: Mapping[int, Memory]) -> None:
        self.near: frozenset[int] = frozenset()
        self._always = frozenset(always)
        self._memories = memories
        self._known: dict[int, Sighting] = {}
        self._near_since_ns: dict[int, int] = {}

    def look(self, own: Seen, heard: Heard, told: Told, now_ns: int) -> tuple[Seen, ...]:
        """Decides anew whom to hear directly.

        Args:
            own: As what this drone sees itself.
            heard: The newest state of each that was ever heard.
            told: What each of those who tell told last.
            now_ns: Own clock.

        Returns:
            What to tell: itself first, then the others, the nearest of many.
        """
        self._known = newest(self._memories, heard, told, now_ns)
        others = [sighting.now(now_ns) for sighting in self._known.values()]
        strangers = [seen for seen in others if seen.id not in self._always and self._may_fly(seen, now_ns)]
        self.near = who_comes_near(own, strangers, self.near)
        since = self._near_since_ns
        self._near_since_ns = {drone: since.get(drone, now_ns) for drone in self.near}
        others.sort(key=lambda seen: math.dist(seen.position, own.position))
        return (own, *others[: MOST_SEEN - 1])

    def counted(self, heard: Heard, now_ns: int) -> list[int]:
        """Returns who of those that are near is to be heard by now: a link takes its time."""
        return [
            drone
            for drone, since_ns in self._near_since_ns.items()
            if now_ns - since_ns > _LINKED_AFTER_NS or (drone in heard and heard[drone].arrival_ns >= since_ns)
        ]

    def known(self, now_ns: int) -> Callable[[int], Seen | None]:
        """Returns what says as what a drone was known when this one looked last, None if nothing is."""

        def seen(drone: int) -> Seen | None:
            sighting = self._known.get(drone)
            return None if sighting is None else sighting.now(now_ns)

        return seen

    def _may_fly(self, seen: Seen, now_ns: int) -> bool:
        return may_fly(seen, self._memories[seen.id], None, now_ns)


def newest(drones: Collection[int], heard: Heard, told: Told, now_ns: int) -> dict[int, Sighting]:
    """Returns the newest of what was heard and told of each drone, as far as anything is known.

    Who is heard needs nobody to tell of it. Of what is told the highest number counts, as far as it is about as
    fresh as the rest: what nobody has seen any more, be it a number out of the future, ages while it is passed
    on. Of two tellings of the same the older is right: on its way a word ages unnoticed.
    """
    found = {drone: _newest_told(each) for drone, each in _told_of(drones, told).items()}
    for drone in drones:
        if (sensed := heard.get(drone)) is not None:
            own, word = Sighting(seen_of(sensed, 0.0), sensed.arrival_ns), found.get(drone)
            if word is None or sensed.age(now_ns) <= DRONE_STATE.stale_s or _order(own) > _order(word):
                found[drone] = own
    return found


def _newest_told(sightings: Iterable[Sighting]) -> Sighting:
    fresh_ns = max(sighting.at_ns for sighting in sightings) - round(PLACES.stale_s * NS_PER_S)
    return max((sighting for sighting in sightings if sighting.at_ns >= fresh_ns), key=_order)


def _told_of(drones: Collection[int], told: Told) -> dict[int, list[Sighting]]:
    sightings: dict[int, list[Sighting]] = {}
    for sensed in told.values():
        for seen in sensed.message.seen:
            if seen.id in drones:
                at_ns = sensed.arrival_ns - round(seen.age * NS_PER_S)
                sightings.setdefault(seen.id, []).append(Sighting(seen, at_ns))
    return sightings


def _order(sighting: Sighting) -> tuple[int, int, int]:
    return (sighting.seen.epoch, sighting.seen.seq, -sighting.at_ns)


def who_comes_near(own: Seen, strangers: Iterable[Seen], before: frozenset[int]) -> frozenset[int]:
    """Returns whom to hear directly, the nearest of many.

    Args:
        own: As what this drone sees itself.
        strangers: Those who fly and are not heard anyway.
        before: Whom it hears directly so far.
    """
    gaps = {seen.id: _gap(own, seen) for seen in strangers}
    near = [drone for drone, gap in gaps.items() if gap < NEAR + (APART if drone in before else 0.0)]
    return frozenset(sorted(near, key=gaps.__getitem__)[:MOST_NEAR])


def _gap(own: Seen, other: Seen) -> float:
    """Returns how near somebody may come soon, horizontally, m."""
    (a, b, _), (p, q, _) = own.position, other.position
    (c, d, _), (r, s, _) = own.velocity, other.velocity
    x, y = p - a, q - b
    distance = math.hypot(x, y)
    closing = -(x * (r - c) + y * (s - d)) / distance if distance > 0.0 else 0.0
    return distance - max(closing, 0.0) * AHEAD - UNSURE * other.age
