"""The lockstep simulator: real agents on a virtual clock, exchanging messages or their encoded bytes.

In a tick the hand's sample reaches everybody, then the agents step level by level on their bodies' poses, each
published state reaches its listeners at once, and at the end the bodies move on (DESIGN section 4). The same
inputs give the same bytes, and messages handed over as they are give the same flight as their bytes.
"""

from collections.abc import Iterable, Sequence
from collections.abc import Set as AbstractSet

import numpy as np

from agents.agent import Agent
from agents.settings import agent_settings, hand_settings
from agents.vehicles.bodies.fleet import Flyer, advance, pose_of
from agents.vehicles.bodies.state import CUT, FLY, IDLE
from deploy.lockstep.hand_track import map_samples, track_of
from deploy.lockstep.record import Moment, Record, make_record
from deploy.lockstep.start import EPOCH, introduce, rest_places, start_flyers
from deploy.lockstep.ticks import tick_length, tick_ns
from shared.codec import encode
from shared.formation import Formation
from shared.messages import DroneState, HandSample, Mode, Places, Vector
from shared.scenario import Scenario
from shared.senses import Sensed, Senses
from shared.topics import DRONE_STATE, HAND, PLACES
from shared.transport import Arrival

_HAND_KEY = HAND.key()
_COMMANDS = dict.fromkeys(Mode, FLY) | {Mode.STOP: CUT, Mode.GROUND: IDLE}


def hand_over(listeners: Iterable[Senses], message: HandSample | DroneState | Places, now_ns: int) -> None:
    """Hands a message over as it is.

    Raises:
        DecodeError: It is not newer than the last one of its kind.
    """
    if isinstance(message, HandSample):
        sample = Sensed(message, now_ns)
        for senses in listeners:
            senses.hear_hand(sample)
    elif isinstance(message, DroneState):
        state = Sensed(message, now_ns)
        for senses in listeners:
            senses.hear_drone(state)
    else:
        places = Sensed(message, now_ns)
        for senses in listeners:
            senses.hear_places(places)


class Lockstep:
    """Agents and bodies of one swarm, driven tick by tick.

    Args:
        scenario: The scenario.
        formation: Its formation.
        flyers: Bodies at the start, one per drone in the formation's order.
        encoded: Whether agents hear bytes, as in flight; it takes longer.

    Attributes:
        flyers: The bodies now, in the formation's order.
        tick: Number of the next tick.
        followed: The drones that have been in FOLLOW.
        payloads: If encoded: what was published in the last tick, by key.
    """

    def __init__(
        self, scenario: Scenario, formation: Formation, flyers: Sequence[Flyer], *, encoded: bool = True
    ) -> None:
        self.flyers = list(flyers)
        self.tick = 0
        self.followed: set[int] = set()
        self.payloads: dict[str, bytes] = {}
        self._encoded = encoded
        self._rate = scenario.rates.control_hz
        self._order = [row for level in formation.levels for row in level]
        self._agents = [
            Agent(scenario, formation, drone, agent_settings(scenario, formation, drone), epoch=EPOCH)
            for drone in formation.ids
        ]
        introduce(self._agents, formation, self.flyers)
        self._ids = formation.ids
        self._keys = [DRONE_STATE.key(id=drone) for drone in formation.ids]
        self._near: list[frozenset[int]] = []
        self._listeners: dict[str, list[Senses]] = {}

    def advance(self, sample: HandSample) -> list[DroneState]:
        """Makes one tick.

        Args:
            sample: What the relay sends in this tick.

        Returns:
            What each drone published, in the formation's order.
        """
        now = tick_ns(self.tick, self._rate)
        self.payloads = {}
        self._listen()
        self._publish(_HAND_KEY, sample, now)
        states: dict[int, DroneState] = {}
        for row in self._order:
            agent = self._agents[row]
            states[row] = agent.step(now, pose_of(self.flyers[row], 1.0, self.tick), 0.0)
            self._publish(self._keys[row], states[row], now)
            if (told := agent.places()) is not None:
                self._publish(PLACES.key(id=told.id), told, now)
        ordered = [states[row] for row in range(len(states))]
        self.followed.update(state.id for state in ordered if state.mode is Mode.FOLLOW)
        duration = tick_length(self.tick, self._rate)
        self.flyers = [
            advance(self.flyers[row], _COMMANDS[state.mode], state.setpoint, duration)
            for row, state in enumerate(ordered)
        ]
        self.tick += 1
        return ordered

    def _listen(self) -> None:
        """Notes who hears whom, if that has changed."""
        near = [agent.near for agent in self._agents]
        if near == self._near:
            return
        self._near = near
        senses = [(agent, agent.senses) for agent in self._agents]
        self._listeners = {_HAND_KEY: [own for _, own in senses]}
        for drone in self._ids:
            self._listeners[DRONE_STATE.key(id=drone)] = [own for agent, own in senses if agent.hears(drone)]
            self._listeners[PLACES.key(id=drone)] = [own for agent, own in senses if drone in agent.tellers]

    def _publish(self, key: str, message: HandSample | DroneState | Places, now_ns: int) -> None:
        if self._encoded:
            self.payloads[key] = payload = encode(message)
            for senses in self._listeners[key]:
                senses.take({key: [Arrival(payload, now_ns)]})
        else:
            hand_over(self._listeners[key], message, now_ns)


def fly_lockstep(
    scenario: Scenario,
    formation: Formation,
    samples: Sequence[HandSample],
    *,
    airborne: bool = True,
    held: AbstractSet[int] = frozenset(),
    places: Sequence[Vector] | None = None,
    encoded: bool = False,
) -> Record:
    """Flies a whole hand.

    Args:
        scenario: The scenario.
        formation: Its formation.
        samples: One per tick, at least one.
        airborne: Start hovering in the rest formation; else on the ground below it.
        held: Drones that a hand holds in place.
        places: Where to start instead, in the formation's order, m.
        encoded: See `Lockstep`.

    Returns:
        The run.
    """
    hands = map_samples(samples, hand_settings(scenario, formation))
    rows = {formation.row(drone) for drone in held}
    start = rest_places(formation, hands[0][1]) if places is None else places
    flyers = start_flyers(scenario, formation, start, airborne=airborne, held=rows)
    swarm = Lockstep(scenario, formation, flyers, encoded=encoded)
    moments = [_moment(formation, swarm.advance(sample)) for sample in samples]
    return make_record(formation, track_of(hands), moments, swarm.followed)


def _moment(formation: Formation, states: list[DroneState]) -> Moment:
    return Moment(
        position=np.array([state.position for state in states]),
        goal=np.array([state.goal for state in states]),
        setpoint=np.array([state.setpoint for state in states]),
        displacement=np.array(
            [states[link.target].displacements[link.name] for link in formation.links]
        ).reshape(-1, 3),
    )
