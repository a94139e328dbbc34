"""What the launcher hears of the flight: decodes, feeds the statistics, remembers who is there."""

from collections import Counter

from human_relay.relay import HAND_JUMP, IMPOSSIBLE_POSE
from observer.flight_stats import FlightStats
from observer.glove_log import GloveLog
from shared.clock import Clock
from shared.codec import decode_on
from shared.errors import DecodeError
from shared.formation import Formation
from shared.messages import DroneState, HandSample, Heard, Message, Mode, PatternEvent, ProcessStatus, Wish
from shared.nodes import RELAY, admits, processes
from shared.order import check_newer
from shared.topics import DRONE_STATE, HAND, PATTERN, STATUS, topic_of
from shared.transport import TOO_MANY, Bus, Inbox

INBOX_DEPTH = 4096
"""Samples kept per key between two drains: a minute of them, so that the statistics miss none."""
_ON_THE_GROUND = (Mode.GROUND, Mode.STOP)


class Monitor:
    """Listens to hand, states, patterns, health and presence; says nothing.

    Args:
        bus: The observer's connection to the swarm.
        formation: The formation that flies.
        clock: The launcher's clock.

    Attributes:
        asked: Whether the hand has ever wished that the drones fly.
    """

    def __init__(self, bus: Bus, formation: Formation, clock: Clock) -> None:
        self.stats = FlightStats(formation)
        self.glove = GloveLog()
        self.present: set[str] = set()
        self.health: dict[str, Health] = {}
        self.rejected: Counter[str] = Counter()
        self.asked = False
        self._ids, self._expected = formation.ids, processes(formation)
        self._newest: dict[str, Heard] = {}
        self._inbox = Inbox(clock, INBOX_DEPTH)
        for topic in (HAND, DRONE_STATE, PATTERN, STATUS):
            bus.subscribe(topic.wildcard, self._inbox)
        bus.watch_presence(self._presence_changed)

    def drain(self) -> None:
        """Takes everything that has arrived, whatever it is; call it at 20 Hz or more."""
        hands: list[HandSample] = []
        states: list[DroneState] = []
        for key, arrivals in self._inbox.take().items():
            for payload, arrival_ns in arrivals:
                try:
                    message = decode_on(key, payload)
                    self._check_newer(key, message, arrival_ns)
                except DecodeError as error:
                    self.rejected[error.reason] += 1
                    continue
                match message:
                    case HandSample():
                        hands.append(message)
                    case DroneState():
                        states.append(message)
                    case PatternEvent():
                        self.glove.add(message)
                    case ProcessStatus():
                        self._add_status(f"{message.role}/{message.id}", message)
                    case _:
                        pass
        self.asked |= any(hand.mode is Wish.FLY for hand in hands)
        self.stats.update(hands, states)

    @property
    def rejected_poses(self) -> int:
        """How many poses of the hand the relay has refused as impossible."""
        return self._refused(IMPOSSIBLE_POSE)

    @property
    def hand_jumps(self) -> int:
        """How often the hand has jumped."""
        return self._refused(HAND_JUMP)

    def _refused(self, reason: str) -> int:
        health = self.health.get(f"{RELAY}/0")
        return health.rejected[reason] if health else 0

    @property
    def all_down(self) -> bool:
        """Whether no drone is known to be in the air."""
        return all(state.mode in _ON_THE_GROUND for state in self.stats.latest.values())

    @property
    def all_landed(self) -> bool:
        """Whether every drone has been heard and is on the ground, not by an emergency stop."""
        modes = [state.mode for state in self.stats.latest.values()]
        return len(modes) == len(self._ids) and all(mode is Mode.GROUND for mode in modes)

    @property
    def stopped(self) -> tuple[int, ...]:
        """The drones whose motors are off for good, by STOP."""
        return tuple(sorted(drone for drone, state in self.stats.latest.items() if state.mode is Mode.STOP))

    @property
    def ended_by_hand(self) -> bool:
        """Whether the hand itself has ended the flight and everybody is down."""
        hand = self.stats.hand
        return hand is not None and hand.mode in (Wish.LAND, Wish.STOP) and self.all_down

    def _check_newer(self, key: str, message: Message, arrival_ns: int) -> None:
        """Refuses what the swarm refuses, too: else one number out of the future ends all statistics."""
        if isinstance(message, HandSample | DroneState):
            sample = Heard(message.epoch, message.seq, arrival_ns)
            if (last := self._newest.get(key)) is not None:
                check_newer(sample, last, topic_of(key).stale_s)
            self._newest[key] = sample

    def _add_status(self, token: str, status: ProcessStatus) -> None:
        if not admits(self._expected, self.health, token):
            self.rejected[TOO_MANY] += 1
            return
        self.health.setdefault(token, Health()).add(status)

    def _presence_changed(self, token: str, present: bool) -> None:
        """Called by the bus, on its thread: single set operations only."""
        if present and admits(self._expected, self.present, token):
            self.present.add(token)
        else:
            self.present.discard(token)


class Health:
    """The newest status of one process, and what it comes to over the flight.

    Attributes:
        status: The newest status, None before the first.
        rss_mb: Largest resident memory, MB.
    """

    def __init__(self) -> None:
        self.status: ProcessStatus | None = None
        self.rss_mb = 0.0
        self._cpu_sum, self._cpu_count = 0.0, 0
        self._rejected_before: Counter[str] = Counter()

    def add(self, status: ProcessStatus) -> None:
        """Takes the next status."""
        if self.status and self.status.epoch != status.epoch:
            self._rejected_before.update(self.status.rejected)
        self.status = status
        self.rss_mb = max(self.rss_mb, status.rss_mb)
        if status.seq > 0:  # the first of an epoch covers the start-up
            self._cpu_sum += status.cpu
            self._cpu_count += 1

    @property
    def rejected(self) -> Counter[str]:
        """What it has dropped, by reason, over all of its restarts."""
        return self._rejected_before + Counter(self.status.rejected if self.status else {})

    @property
    def cpu(self) -> float:
        """Mean fraction of one core."""
        return self._cpu_sum / self._cpu_count if self._cpu_count else 0.0
