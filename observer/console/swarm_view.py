"""What the console knows of the swarm, and how it is told to a page: messages in, JSON objects out.

No I/O: arrivals and time come in. Nothing that anyone sends raises.
"""

from collections import Counter
from collections.abc import Mapping, Sequence

from observer.console.notices import notices
from observer.console.protocol import Json
from observer.console.scene import HandMap
from shared.clock import NS_PER_S
from shared.codec import decode_on
from shared.errors import DecodeError
from shared.formation import Formation
from shared.messages import (
    NO_HAND,
    DroneState,
    Flag,
    FormationState,
    HandSample,
    Mode,
    ObstacleState,
    PatternEvent,
    ProcessStatus,
    Vector,
)
from shared.nodes import WORLD, admits, processes
from shared.obstacle_watch import ObstacleWatch
from shared.plain_text import plain
from shared.senses import Sensed, Senses
from shared.topics import DRONE_STATE, FORMATION_STATE, HAND, OBSTACLE, PATTERN, STATUS
from shared.transport import TOO_MANY, Arrival

Frames = Mapping[str, Sequence[Json]]
"""Pattern name -> frames `{ms, hz: {finger: Hz}}`."""

MYSELF = "console/0"
"""A process does not hear itself; of another console only that it is there would be known."""
_AIRBORNE = frozenset({Mode.TAKEOFF, Mode.FOLLOW, Mode.HOLD, Mode.LAND})


class SwarmView:
    """Listens, and describes what it has heard.

    Args:
        formation: What flies.
        hand: Mapping of the hand.
        patterns: Frames of the glove's patterns, empty if unknown.
        cues: Names of the safety cues among them.
        start_ns: When the console's own time begins.

    Attributes:
        present: Tokens of the processes that announce themselves, for example `drone/2`.
        rejected: Dropped messages by reason.
    """

    def __init__(
        self, formation: Formation, hand: HandMap, patterns: Frames, cues: frozenset[str], start_ns: int
    ) -> None:
        self.present: set[str] = set()
        self.rejected: Counter[str] = Counter()
        self._senses, self._expected = Senses(formation.ids), processes(formation)
        self._sensed = frozenset(self._senses.keys)
        self._hand, self._patterns, self._cues, self._start_ns = hand, patterns, cues, start_ns
        self._formation: Sensed[FormationState] | None = None
        self._obstacles = ObstacleWatch()
        self._statuses: dict[str, Sensed[ProcessStatus]] = {}
        self._playing: Sensed[PatternEvent] | None = None

    @property
    def keys(self) -> list[str]:
        """Key expressions to subscribe to."""
        return [
            *self._senses.keys,
            OBSTACLE.wildcard,
            FORMATION_STATE.wildcard,
            PATTERN.wildcard,
            STATUS.wildcard,
        ]

    @property
    def airborne(self) -> bool:
        """Whether any drone is known to be in the air."""
        return any(sensed.message.mode in _AIRBORNE for sensed in self._senses.drones.values())

    @property
    def hand_position(self) -> Vector | None:
        """Where the relay last said that the hand is, None before it has seen one, m."""
        hand = self._senses.hand
        return None if hand is None or hand.message.position == NO_HAND else hand.message.position

    def take(self, arrivals: Mapping[str, Sequence[Arrival]], now_ns: int) -> list[Json]:
        """Takes what has arrived; returns the `pattern` messages that it makes."""
        self._senses.take({key: samples for key, samples in arrivals.items() if key in self._sensed})
        events: list[Json] = []
        for key, samples in arrivals.items():
            if key in self._sensed:
                continue
            for payload, arrival_ns in samples:
                try:
                    message = decode_on(key, payload)
                    if isinstance(message, ObstacleState):
                        self._obstacles.hear(message.id, message, arrival_ns)
                except DecodeError as error:
                    self.rejected[error.reason] += 1
                    continue
                match message:
                    case PatternEvent():
                        events.append(self._pattern(Sensed(message, arrival_ns), now_ns))
                    case FormationState():
                        self._formation = Sensed(message, arrival_ns)
                    case ProcessStatus():
                        self._add_status(Sensed(message, arrival_ns))
                    case _:
                        pass
        return events

    def presence_changed(self, token: str, present: bool) -> None:
        """Takes in that a process came or left; called on the bus's thread: single set operations only."""
        if present and token != MYSELF and admits(self._expected, self.present, token):
            self.present.add(token)
        else:
            self.present.discard(token)

    def snapshot(self, now_ns: int) -> Json:
        """Returns the `snapshot` message."""
        hand, formation = self._senses.hand, self._formation
        return {
            "type": "snapshot",
            "t": self._seconds(now_ns),
            "hand": None if hand is None or self.hand_position is None else self._hand_of(hand, now_ns),
            "drones": [_drone(sensed, now_ns) for _, sensed in sorted(self._senses.drones.items())],
            "obstacles": [_obstacle(state, age) for state, age in self._obstacles.present(now_ns)],
            "formation": None if formation is None or _is_old(formation, now_ns) else _shape(formation.message),
        }

    def notices(self, now_ns: int) -> Json:
        """Returns the `notices` message."""
        drones, hand = self._senses.drones, self._senses.hand
        missing = [i for i, sensed in drones.items() if sensed.age(now_ns) > DRONE_STATE.stale_s]
        states = {i: sensed.message for i, sensed in drones.items()}
        silent = hand is not None and hand.age(now_ns) > HAND.stale_s
        jumped = hand is not None and hand.message.jumped
        found = notices(states, missing, hand_silent=silent, hand_jumped=jumped)
        return {"type": "notices", "notices": found}

    def health(self, now_ns: int) -> Json:
        """Returns the `health` message."""
        world = self._statuses.get(f"{WORLD}/0")
        return {
            "type": "health",
            "t": self._seconds(now_ns),
            "processes": [self._process(token, now_ns) for token in sorted(self.present.union(self._statuses))],
            "referee": world.message.metrics if world else {},
        }

    def playing(self, now_ns: int) -> Json | None:
        """Returns the `pattern` message of what the glove plays now, for a page that joins late."""
        return self._describe(self._playing.message, now_ns) if self._playing else None

    def _pattern(self, sensed: Sensed[PatternEvent], now_ns: int) -> Json:
        event = sensed.message
        if event.outcome != "suppressed":
            self._playing = sensed if event.outcome == "started" else None
        return self._describe(event, now_ns)

    def _add_status(self, sensed: Sensed[ProcessStatus]) -> None:
        token = f"{sensed.message.role}/{sensed.message.id}"
        if not admits(self._expected, self._statuses, token):
            self.rejected[TOO_MANY] += 1
            return
        self._statuses[token] = sensed

    def _describe(self, event: PatternEvent, now_ns: int) -> Json:
        started = event.outcome == "started" and event.started_ns > 0
        return {
            "type": "pattern",
            "t": self._seconds(now_ns),
            "name": plain(event.pattern),
            "outcome": plain(event.outcome),
            "cue": event.pattern in self._cues,
            "frames": list(self._patterns.get(event.pattern, ())),
            "elapsed": max(0.0, (now_ns - event.started_ns) / NS_PER_S) if started else 0.0,
        }

    def _hand_of(self, hand: Sensed[HandSample], now_ns: int) -> Json:
        sample = hand.message
        return {
            "point": self._hand.mapped(sample.position),
            "real": sample.position,
            "velocity": sample.velocity,
            "yaw": sample.yaw,
            "wish": sample.mode,
            "age": hand.age(now_ns),
        }

    def _process(self, token: str, now_ns: int) -> Json:
        role, _, number = token.partition("/")
        sensed = self._statuses.get(token)
        status = sensed.message if sensed else None
        return {
            "name": role if number == "0" else f"{role}-{number}",
            "role": role,
            "id": int(number),
            "present": token in self.present,
            "state": plain(status.state) if status else "starting",
            "rate_hz": status.rate_hz if status else 0.0,
            "cpu": status.cpu if status else 0.0,
            "rss_mb": status.rss_mb if status else 0.0,
            "rejected": sum(status.rejected.values()) if status else 0,
            "age": sensed.age(now_ns) if sensed else None,
        }

    def _seconds(self, now_ns: int) -> float:
        return (now_ns - self._start_ns) / NS_PER_S


def _drone(sensed: Sensed[DroneState], now_ns: int) -> Json:
    state = sensed.message
    return {
        "id": state.id,
        "position": state.position,
        "velocity": state.velocity,
        "goal": state.goal,
        "setpoint": state.setpoint,
        "mode": state.mode,
        "flags": [flag.name.lower() for flag in Flag if flag in state.flags and flag.name],
        "battery": state.battery,
        "age": sensed.age(now_ns),
        "links": {plain(name): displacement for name, displacement in state.displacements.items()},
    }


def _obstacle(state: ObstacleState, age: float) -> Json:
    return {
        "id": state.id,
        "position": state.position,
        "velocity": state.velocity,
        "radius": state.radius,
        "height": state.height,
        "age": age,
    }


def _shape(state: FormationState) -> Json:
    names = ("area", "area_ratio", "extent", "trend", "displacement", "missing")
    return {name: getattr(state, name) for name in names}


def _is_old(sensed: Sensed[FormationState], now_ns: int) -> bool:
    return sensed.age(now_ns) > FORMATION_STATE.stale_s
