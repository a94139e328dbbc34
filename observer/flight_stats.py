"""Statistics of a flight from the messages alone: messages in, numbers out; no clock, no I/O.

Everything derives from what the processes publish. Steps and losses are counted by `(epoch, seq)`, never by
what the observer happened to receive. A hand sample is followed through the swarm by the `heard` entries: the
newest sample that has come to a set-point *through every hop* of the reference path is, per state,

    through(state) = max of  number(heard hand)              if the drone refers to the human,
                             through(heard state of r)       for every drone r that it refers to,

which costs O(references) per state. The counts of an agent begin with its first step that used a hand sample:
before that there is nothing to be on time for.
"""

import math
from collections.abc import Iterable

from attrs import frozen

from observer.agent_log import AgentLog, AgentSummary
from observer.hand_log import HandLog
from shared.formation import Formation
from shared.geometry import hull_area
from shared.messages import DroneState, HandSample, Mode

_FORMED = (Mode.FOLLOW, Mode.HOLD)


@frozen(kw_only=True)
class Spread:
    """Mean, smallest and largest of a number over the flight."""

    mean: float
    min: float
    max: float


@frozen(kw_only=True)
class FormationSummary:
    """The formation while all of its drones were in FOLLOW or HOLD.

    Attributes:
        area_m2: Convex hull of the horizontal positions; None if they never all flew.
        distances_m: Distance between reference neighbours, `"1-2"` -> metres.
    """

    area_m2: Spread | None
    distances_m: dict[str, Spread]


class FlightStats:
    """Follows one flight.

    Args:
        formation: The formation that flies.
    """

    def __init__(self, formation: Formation) -> None:
        self.latest: dict[int, DroneState] = {}
        self.hand: HandSample | None = None
        self._hands = HandLog()
        self._agents = {drone: AgentLog(drone, formation) for drone in formation.ids}
        self._depth = {formation.ids[row]: depth for depth, rows in enumerate(formation.levels) for row in rows}
        self._pairs = [(r, d) for d in formation.ids for r in formation.references(d)]
        self._area = _Extent()
        self._distances = {f"{one}-{other}": _Extent() for one, other in self._pairs}

    def update(self, hands: Iterable[HandSample], states: Iterable[DroneState]) -> None:
        """Takes what has arrived since the last call; the formation is sampled once per call.

        Args:
            hands: Hand samples in the order of arrival.
            states: States of any drones, in the order of arrival per drone; those of drones that the
                formation does not know are ignored.
        """
        for hand in hands:
            self._hands.add(hand)
            self.hand = hand
        known = [state for state in states if state.id in self._agents]
        # References first: a state may arrive here before the states of others that it was computed from.
        for state in sorted(known, key=lambda state: self._depth[state.id]):
            self._agents[state.id].add(state, self._hands, self._agents)
            self.latest[state.id] = state
        if known:
            self._sample_formation()

    def latency_ms(self, drone: int) -> float | None:
        """Returns the newest latency of one drone, ms, None while it has none."""
        return self._agents[drone].newest_latency_ms

    def agents(self) -> tuple[AgentSummary, ...]:
        """Returns the summary of every agent so far, by number."""
        return tuple(self._agents[drone].summary() for drone in sorted(self._agents))

    def formation(self) -> FormationSummary:
        """Returns the summary of the formation so far."""
        distances = {name: spread for name, extent in self._distances.items() if (spread := extent.spread())}
        return FormationSummary(area_m2=self._area.spread(), distances_m=distances)

    def _sample_formation(self) -> None:
        if len(self.latest) < len(self._agents) or any(s.mode not in _FORMED for s in self.latest.values()):
            return
        self._area.add(hull_area(state.position[:2] for state in self.latest.values()))
        for one, other in self._pairs:
            gap = math.dist(self.latest[one].position, self.latest[other].position)
            self._distances[f"{one}-{other}"].add(gap)


class _Extent:
    """Running mean, minimum and maximum."""

    def __init__(self) -> None:
        self._count, self._sum, self._min, self._max = 0, 0.0, math.inf, -math.inf

    def add(self, value: float) -> None:
        self._count += 1
        self._sum += value
        self._min = min(self._min, value)
        self._max = max(self._max, value)

    def spread(self) -> Spread | None:
        if not self._count:
            return None
        return Spread(mean=self._sum / self._count, min=self._min, max=self._max)
