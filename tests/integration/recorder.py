"""Hears a whole swarm of real processes, keeps everything, and judges it."""

import time
from bisect import insort
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Self

from shared.bus import join
from shared.clock import NS_PER_S, system_clock
from shared.codec import decode
from shared.errors import DecodeError
from shared.formation import build_formation
from shared.messages import DroneState, HandSample, Message, Mode, ProcessStatus
from shared.nodes import OBSERVER
from shared.scenario import Scenario
from shared.topics import DRONE_STATE, HAND, STATUS
from shared.transport import Inbox
from tests.integration.floor import Floor

START_S = 30.0
"""Time for processes to start on a busy machine."""
RELAY, WORLD = "relay/0", "world/0"

Key = tuple[int, int]
"""(epoch, seq)."""


class Recorder:
    """Hears a whole swarm and keeps everything.

    Attributes:
        hands: Every hand sample by (epoch, seq).
        states: Every state per drone, in order.
        statuses: Newest status per process, as `role/id`.
        present: Who announces itself.
        refused: Payloads that were no valid message, or of another drone.
        floor: What this machine has given meanwhile to whoever only waits.
    """

    def __init__(self, scenario: Scenario) -> None:
        formation = build_formation(scenario)
        self.ids = formation.ids
        self.hands: dict[Key, HandSample] = {}
        self.states: dict[int, list[DroneState]] = {drone: [] for drone in self.ids}
        self.statuses: dict[str, ProcessStatus] = {}
        self.present: set[str] = set()
        self.refused = 0
        self.clock = system_clock()
        self.floor = Floor(self.clock)
        self._inbox = Inbox(self.clock, depth=1_000_000)
        self._known: set[tuple[int, int, int]] = set()
        # Best effort may lose a sample on one link; of two links, it hardly does on both.
        self._buses = [join(scenario, formation, OBSERVER, listening=False) for _ in range(2)]
        for bus in self._buses:
            for key in (HAND.key(), *(DRONE_STATE.key(id=drone) for drone in self.ids), STATUS.wildcard):
                bus.subscribe(key, self._inbox)
        self._buses[0].watch_presence(self._presence_changed)

    def drain(self) -> None:
        """Takes in what has arrived."""
        for key, arrivals in self._inbox.take().items():
            for payload, _ in arrivals:
                try:
                    self._keep(key, payload)
                except DecodeError:
                    self.refused += 1

    def until(self, condition: Callable[[], bool], limit_s: float) -> float:
        """Listens until it holds; returns how long that took, s."""
        start = time.monotonic()
        self.drain()
        while not condition():
            left = start + limit_s - time.monotonic()
            assert left > 0, f"not within {limit_s} s; {self._sight()}"
            self._inbox.wait(min(left, 0.05))
            self.drain()
        return time.monotonic() - start

    @property
    def losses(self) -> int:
        """How many states and hand samples are missing."""
        hands = sorted(self.hands.values(), key=lambda hand: (hand.epoch, hand.seq))
        return lost(hands) + sum(map(lost, self.states.values()))

    def listen(self, seconds: float) -> None:
        """Listens for a while."""
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() >= end, seconds + START_S)

    def latest(self, drone: int) -> DroneState:
        """Returns the newest state of a drone that has been heard."""
        return self.states[drone][-1]

    def all_in(self, mode: Mode, drones: Iterable[int] = ()) -> bool:
        """Says whether all of these drones (or just all) are in a mode, by states younger than 0.2 s."""
        recent_ns = self.clock() - NS_PER_S // 5
        return all(
            bool(self.states[drone])
            and self.latest(drone).mode is mode
            and self.latest(drone).stamp_ns >= recent_ns
            for drone in (tuple(drones) or self.ids)
        )

    def since(self, drone: int, start_ns: int) -> list[DroneState]:
        """Returns the states of a drone whose step began at or after a moment."""
        return [state for state in self.states[drone] if state.step_ns >= start_ns]

    def close(self) -> None:
        """Leaves the swarm."""
        self.floor.close()
        for bus in self._buses:
            bus.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _keep(self, key: str, payload: bytes) -> None:
        if key == HAND.key():
            hand = decode(payload, HandSample)
            self.hands[hand.epoch, hand.seq] = hand
        elif key.startswith("status/"):
            self.statuses[key.removeprefix("status/")] = decode(payload, ProcessStatus)
        else:
            state = decode(payload, DroneState)
            if key != DRONE_STATE.key(id=state.id):
                raise DecodeError("wrong-id", key)
            if (known := (state.id, state.epoch, state.seq)) not in self._known:
                self._known.add(known)
                insort(self.states[state.id], state, key=lambda state: (state.epoch, state.seq))

    def _presence_changed(self, token: str, present: bool) -> None:
        (self.present.add if present else self.present.discard)(token)

    def _sight(self) -> str:
        modes = {drone: states[-1].mode.value for drone, states in self.states.items() if states}
        return f"present {sorted(self.present)}, modes {modes}"


def slowest_rate_hz(states: Sequence[DroneState]) -> float:
    """Returns the slowest rate of steps over any second, Hz; steps are counted by number, heard or not."""
    lowest, last = float("inf"), 0
    for begin in states:
        while last < len(states) and states[last].step_ns < begin.step_ns + NS_PER_S:
            last += 1
        if last == len(states):
            break
        end = states[last]
        lowest = min(lowest, (end.seq - begin.seq) * NS_PER_S / (end.step_ns - begin.step_ns))
    assert lowest < float("inf"), "less than a second"
    return lowest


def lost(messages: Sequence[Message]) -> int:
    """Returns how many messages of one publisher are missing between the first and the last."""
    return sum(b.seq - a.seq - 1 for a, b in pairwise(messages) if a.epoch == b.epoch)
