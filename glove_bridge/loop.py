"""The bridge's loop: receive -> compute -> play and publish, whenever something arrives."""

import logging
import threading
from collections import deque

from glove_bridge.bridge import GLOVE_THERE, Bridge, Step
from glove_bridge.gloves.base import Glove, Outcome
from shared.clock import NS_PER_S, Clock
from shared.codec import encode
from shared.nodes import BRIDGE
from shared.process import StatusReporter
from shared.topics import FORMATION_STATE, PATTERN
from shared.transport import Bus, Inbox

LONGEST_WAIT = 0.05
"""The loop looks at the stop event and at who has fallen silent at least this often, s."""

REST = 0.004
"""Shortest time between two steps, s: the states of one tick of the swarm are worth few steps, not one each."""

_STATE_PERIOD_NS = round(NS_PER_S / FORMATION_STATE.rate_hz)
_log = logging.getLogger("bridge")


class Voice:
    """What the bridge publishes.

    Args:
        bridge: Whose states and events.
        bus: Where.
    """

    def __init__(self, bridge: Bridge, bus: Bus) -> None:
        self._bridge = bridge
        self._state, self._pattern = bus.publisher(FORMATION_STATE), bus.publisher(PATTERN)
        self._due_ns = 0

    def tell(self, step: Step, now_ns: int) -> None:
        """Publishes the state at its rate, and at once if it caused something; and the events of a step."""
        if now_ns >= self._due_ns or step.play is not None:
            self._due_ns = max(self._due_ns + _STATE_PERIOD_NS, now_ns)
            self._state(encode(step.state))
            self._bridge.state_published()
        for event in step.events:
            self._pattern(encode(event))

    def tell_reports(self, glove: Glove, now_ns: int) -> None:
        """Publishes what the glove has done since the last call."""
        for report in glove.poll(now_ns):
            event = self._bridge.reported(report, now_ns)
            if event is not None:
                self._pattern(encode(event))
                _log.info("%s %s%s", event.pattern, event.outcome, f": {report.why}" if report.why else "")


def run(bridge: Bridge, glove: Glove, bus: Bus, inbox: Inbox, clock: Clock, stopping: threading.Event) -> None:
    """Runs a bridge until told to stop.

    Args:
        bridge: Its brain.
        glove: What the operator wears; may be out of reach at any time.
        bus: The process's connection to the swarm.
        inbox: Where the bus is to put what it hears.
        clock: The process's clock.
        stopping: Ends the loop.
    """
    presence: deque[tuple[str, bool, int]] = deque()

    def presence_changed(token: str, present: bool) -> None:
        presence.append((token, present, clock()))
        inbox.wake()

    voice, status = Voice(bridge, bus), StatusReporter(bus, BRIDGE, 0, clock)
    for key in bridge.senses.keys:
        bus.subscribe(key, inbox)
    bus.watch_presence(presence_changed)
    told = ""
    while not stopping.is_set():
        while presence:
            bridge.presence_changed(*presence.popleft())
        bridge.receive(inbox.take())
        now = clock()
        voice.tell_reports(glove, now)
        step = bridge.step(now, connected=glove.connected)
        act(glove, step, now)
        voice.tell(step, now)
        voice.tell_reports(glove, now)
        word, sentence = health(bridge, glove)
        if sentence != told:
            told = sentence
            _log.info("%s: %s", word, sentence)
        status.tick(bridge.steps, word, rejected(bridge, glove), lambda: metrics(bridge, glove))
        stopping.wait(REST)
        inbox.wait(patience(glove, clock()))
    status.tick(bridge.steps, "ending", rejected(bridge, glove), lambda: metrics(bridge, glove), force=True)


def act(glove: Glove, step: Step, now_ns: int) -> None:
    """Gives the glove what a step decided."""
    if step.stop:
        glove.stop(now_ns)
    if step.play is not None:
        glove.play(step.play, now_ns)


def health(bridge: Bridge, glove: Glove) -> tuple[str, str]:
    """Returns the status word of the process, and a sentence for its log."""
    faults = []
    if not bridge.senses.drones:
        faults.append("no drone has been heard yet")
    elif bridge.missing:
        faults.append(f"not heard: drone {', '.join(map(str, bridge.missing))}")
    if not glove.connected:
        faults.append(f"no glove: {glove.fault}")
    word = "starting" if not bridge.senses.drones else "degraded" if faults else "running"
    return word, "; ".join(faults) or "every drone is heard, the glove is ready"


def rejected(bridge: Bridge, glove: Glove) -> dict[str, int]:
    """Returns what was dropped, by reason: messages of the swarm, and what the glove has said."""
    return {**bridge.senses.rejected, **{f"glove-{reason}": n for reason, n in glove.rejected.copy().items()}}


def metrics(bridge: Bridge, glove: Glove) -> dict[str, float]:
    """Returns the numbers for the status: events by outcome, missing drones, whether patterns can be felt."""
    counts = {f"patterns_{outcome}": float(bridge.counts[outcome]) for outcome in Outcome}
    return {**counts, "missing": float(len(bridge.missing)), GLOVE_THERE: float(glove.connected)}


def patience(glove: Glove, now_ns: int) -> float:
    """Returns how long the loop may wait for something to arrive, s."""
    next_ns = glove.next_ns()
    return LONGEST_WAIT if next_ns is None else min(LONGEST_WAIT, (next_ns - now_ns) / NS_PER_S)
