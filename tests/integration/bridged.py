"""A swarm of real processes with a bridge to a recording glove, and what comes of it."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from deploy.launcher.process_table import ProcessRow
from shared.bus import ZenohBus
from shared.clock import system_clock
from shared.codec import decode
from shared.formation import build_formation
from shared.messages import FormationState, PatternEvent
from shared.net.settings import peer_settings
from shared.nodes import BRIDGE, endpoint
from shared.nodes import BRIDGE as ROLE
from shared.scenario import Scenario
from shared.topics import FORMATION_STATE, PATTERN
from shared.transport import Inbox
from tests.integration.swarm import Swarm

TOKEN = f"{ROLE}/0"


class BridgeListener:
    """Hears the bridge and keeps everything.

    Attributes:
        events: Pattern events in order.
        states: States of the formation in order.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.events: list[PatternEvent] = []
        self.states: list[FormationState] = []
        self._inbox = Inbox(system_clock(), depth=100_000)
        where = endpoint(scenario, build_formation(scenario), BRIDGE)
        self._bus = ZenohBus(peer_settings(scenario.swarm.name, "", [where]))
        for topic in (PATTERN, FORMATION_STATE):
            self._bus.subscribe(topic.wildcard, self._inbox)

    def drain(self) -> None:
        """Takes in what has arrived."""
        taken = self._inbox.take()
        self.events += (decode(a.payload, PatternEvent) for a in taken.get(PATTERN.key(), []))
        self.states += (decode(a.payload, FormationState) for a in taken.get(FORMATION_STATE.key(), []))

    def started(self, since_ns: int = 0) -> list[PatternEvent]:
        """Returns the events of patterns that started at or after a moment."""
        self.drain()
        return [e for e in self.events if e.outcome == "started" and e.started_ns >= since_ns]

    def close(self) -> None:
        """Leaves the swarm."""
        self._bus.close()


class BridgedSwarm(Swarm):
    """A swarm with a bridge; `glove` is the file that the glove writes."""

    def __init__(self, folder: Path, patterns: str, hand: str, overrides: tuple[str, ...]) -> None:
        super().__init__("rhombus", hand, folder, overrides)
        self.glove = folder / "glove.jsonl"
        worn = ("--glove", f"record://{self.glove}", "--patterns", patterns)
        command = (
            sys.executable,
            "-P",
            "-m",
            "glove_bridge",
            "--scenario",
            str(folder / "scenario.toml"),
            *worn,
        )
        self._rows[TOKEN] = ProcessRow(role=ROLE, number=0, command=command)
        self.listener = BridgeListener(self.scenario)

    def felt_since(self, moment_ns: int) -> list[str]:
        """Returns the patterns that have started since a moment, in order."""
        return [event.pattern for event in self.listener.started(moment_ns)]

    def frames(self) -> list[dict[str, Any]]:
        """Returns what the glove has written."""
        return [json.loads(line) for line in self.glove.read_text().splitlines()]

    def close(self) -> None:
        """Kills what is left."""
        self.listener.close()
        super().close()


@contextmanager
def bridged(
    folder: Path, patterns: str, hand: str = "scripted:hold", *overrides: str
) -> Iterator[BridgedSwarm]:
    """Makes a swarm with a bridge and ends it for sure."""
    swarm = BridgedSwarm(folder, patterns, hand, overrides)
    try:
        yield swarm
    finally:
        swarm.close()
