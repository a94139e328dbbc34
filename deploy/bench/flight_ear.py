"""What the bench hears of a real flight: latencies one by one, and what each hop adds."""

from collections import defaultdict
from collections.abc import Iterable

from attrs import field, frozen

from deploy.launcher.monitor import Monitor
from observer.flight_stats import FlightStats
from shared.clock import system_clock
from shared.codec import encode
from shared.formation import Formation
from shared.messages import DroneState, HandSample, Heard, Mode
from shared.topics import DRONE_STATE, HAND
from shared.transport import Bus

_REMEMBERED = 256


@frozen
class HopTimes:
    """Where the time of one drone's steps went, ms each, from the last input of a step on.

    Attributes:
        transport: From the stamp of that input to its arrival: encoding, bus, the thread that delivers.
        wake: From its arrival to the start of the step: decoding, and waiting where it must.
        step: From the start of the step to its stamp: the vehicle's pose and the control law.
    """

    transport: list[float] = field(factory=list)
    wake: list[float] = field(factory=list)
    step: list[float] = field(factory=list)


class DetailedStats(FlightStats):
    """`FlightStats` that also keeps every single latency.

    Args:
        formation: The formation that flies.

    Attributes:
        latencies_ms: By drone, in the order in which they were seen.
        hops: By drone.
    """

    def __init__(self, formation: Formation) -> None:
        super().__init__(formation)
        self.latencies_ms: dict[int, list[float]] = {drone: [] for drone in formation.ids}
        self.hops = {drone: HopTimes() for drone in formation.ids}
        self._order = {formation.ids[row]: depth for depth, rows in enumerate(formation.levels) for row in rows}
        self._stamps: dict[str, dict[tuple[int, int], int]] = defaultdict(dict)
        self._previous: dict[int, DroneState] = {}

    def update(self, hands: Iterable[HandSample], states: Iterable[DroneState]) -> None:
        """See `FlightStats.update`; states are taken one by one, references first."""
        hands, known = list(hands), [state for state in states if state.id in self._order]
        for hand in hands:
            self._remember(HAND.key(), hand.epoch, hand.seq, hand.stamp_ns)
        for state in known:
            self._remember(DRONE_STATE.key(id=state.id), state.epoch, state.seq, state.stamp_ns)
        super().update(hands, ())
        for state in sorted(known, key=lambda state: self._order[state.id]):
            before = self.latency_ms(state.id)
            super().update((), (state,))
            latency = self.latency_ms(state.id)
            # Two latencies in a row that are equal to the nanosecond count once.
            if latency is not None and latency != before:
                self.latencies_ms[state.id].append(latency)
            self._split(state)

    def _remember(self, key: str, epoch: int, seq: int, stamp_ns: int) -> None:
        stamps = self._stamps[key]
        stamps[epoch, seq] = stamp_ns
        if len(stamps) > _REMEMBERED:
            del stamps[next(iter(stamps))]

    def _split(self, state: DroneState) -> None:
        before = self._previous.get(state.id)
        self._previous[state.id] = state
        if before is None:
            return
        new = {key: heard for key, heard in state.heard.items() if _is_new(heard, before.heard.get(key))}
        if not new:
            return
        key, last = max(new.items(), key=lambda item: item[1].arrival_ns)
        sent_ns = self._stamps[key].get((last.epoch, last.seq))
        if sent_ns is not None:
            times = self.hops[state.id]
            times.transport.append((last.arrival_ns - sent_ns) / 1e6)
            times.wake.append((state.step_ns - last.arrival_ns) / 1e6)
            times.step.append((state.stamp_ns - state.step_ns) / 1e6)


class FlightEar:
    """Listens to a real flight; see `deploy.bench.swarm.Ear`.

    Args:
        bus: The observer's connection.
        formation: The formation that flies.
    """

    def __init__(self, bus: Bus, formation: Formation) -> None:
        self._formation = formation
        self._monitor = Monitor(bus, formation, system_clock())
        self.stats = DetailedStats(formation)
        self._monitor.stats = self.stats

    def drain(self) -> None:
        """Takes what has arrived."""
        self._monitor.drain()

    def hears(self, tokens: Iterable[str]) -> bool:
        """Says whether all of these processes have announced themselves."""
        return self._monitor.present.issuperset(tokens)

    @property
    def following(self) -> float:
        """Fraction of the drones that follow the hand at this moment."""
        modes = [state.mode for state in self.stats.latest.values()]
        return modes.count(Mode.FOLLOW) / len(self._formation.ids)

    @property
    def is_ready(self) -> bool:
        """Whether every drone follows the hand."""
        return self.following >= 1.0

    def begin(self) -> None:
        """Forgets what has been counted so far."""
        self.stats = DetailedStats(self._formation)
        self._monitor.stats = self.stats

    def payload_bytes(self) -> dict[int, int]:
        """Returns the size of the newest payload of the hand (0) and of every drone heard."""
        sizes = {drone: len(encode(state)) for drone, state in self.stats.latest.items()}
        if self.stats.hand is not None:
            sizes[0] = len(encode(self.stats.hand))
        return sizes


def _is_new(heard: Heard, before: Heard | None) -> bool:
    return before is None or (heard.epoch, heard.seq) != (before.epoch, before.seq)
