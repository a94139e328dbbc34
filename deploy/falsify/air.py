"""The air between the processes of a case: who hears what, and when."""

import contextlib
from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from agents.agent import Agent
from deploy.falsify.case import Case, Fault
from deploy.lockstep.lockstep import hand_over
from deploy.lockstep.ticks import tick_ns
from shared.clock import NS_PER_S
from shared.errors import DecodeError
from shared.messages import DroneState, HandSample, Places

Message = HandSample | DroneState | Places

_SENDERS = frozenset({"cut", "mute"})
_HEARERS = frozenset({"cut", "deaf"})
_DRAWN_AT_ONCE = 4096


class Air:
    """Delivers messages between agents as objects, with the losses, delays and silences of a case.

    Args:
        case: Says what the links do.
        ids: Numbers of the drones.
        rate_hz: Ticks per second; delays are whole ticks.
    """

    def __init__(self, case: Case, ids: Sequence[int], rate_hz: float) -> None:
        self._rng = np.random.default_rng(case.seed)
        self._loss = case.weather.loss
        self._silences = [fault for fault in case.faults if fault.kind in (*_SENDERS, *_HEARERS, "relay")]
        # A row per sender, the hand's first; a column per receiver.
        shape = (1 + len(ids), len(ids))
        longest = case.weather.delay * rate_hz
        self._delays = np.rint(self._rng.uniform(0.0, 1.0, shape) * longest).astype(int).tolist()
        self._rows = {drone: row for row, drone in enumerate(ids)}
        self._ids = ids
        self._rate = rate_hz
        self._under_way: dict[int, list[tuple[int, Message]]] = defaultdict(list)
        self._drawn: list[float] = []
        self._mute: frozenset[int] = frozenset()
        self._deaf: frozenset[int] = frozenset()

    def begin(self, tick: int, agents: Sequence[Agent | None]) -> None:
        """Begins a tick: notes who is silent, and delivers what has been under way until now."""
        t = tick_ns(tick, self._rate) / NS_PER_S
        silent = [fault for fault in self._silences if fault.on(t)]
        self._mute = _drones(silent, _SENDERS) | ({0} if any(f.kind == "relay" for f in silent) else set())
        self._deaf = _drones(silent, _HEARERS)
        for row, message in self._under_way.pop(tick, ()):
            self._deliver(row, message, agents[row], tick)

    def publish(self, message: Message, tick: int, agents: Sequence[Agent | None]) -> None:
        """Sends a message of a drone, or of the relay, to everybody who listens to it.

        Args:
            message: What.
            tick: When.
            agents: One per drone; None where there is no process.
        """
        sender = 0 if isinstance(message, HandSample) else message.id
        if sender in self._mute:
            return
        delays = self._delays[self._rows[sender] + 1 if sender else 0]
        for row, agent in enumerate(agents):
            if agent is None or not _hears(agent, message):
                continue
            if self._loss and self._draw() < self._loss:
                continue
            if delays[row]:
                self._under_way[tick + delays[row]].append((row, message))
            else:
                self._deliver(row, message, agent, tick)

    def _deliver(self, row: int, message: Message, agent: Agent | None, tick: int) -> None:
        if agent is None or self._ids[row] in self._deaf:
            return
        # A late one, overtaken by a newer one or by a new process: counted in flight, nothing else.
        with contextlib.suppress(DecodeError):
            hand_over([agent.senses], message, tick_ns(tick, self._rate))

    def _draw(self) -> float:
        if not self._drawn:
            self._drawn = self._rng.random(_DRAWN_AT_ONCE).tolist()
        return self._drawn.pop()


def _hears(agent: Agent, message: Message) -> bool:
    if isinstance(message, HandSample):
        return True
    return message.id in agent.tellers if isinstance(message, Places) else agent.hears(message.id)


def _drones(faults: Sequence[Fault], kinds: frozenset[str]) -> frozenset[int]:
    return frozenset(fault.drone for fault in faults if fault.kind in kinds)
