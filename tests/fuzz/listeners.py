"""Everybody who takes keys, payloads and tokens from anyone, and shows people what was said."""

import json
from collections.abc import Iterable
from functools import cache
from io import StringIO
from typing import Any

from deploy.launcher.flight import Outcome
from deploy.launcher.monitor import Monitor
from deploy.launcher.process_table import GloveChoice
from deploy.launcher.status_view import AgentRow, status_table
from deploy.launcher.summary import flight_summary, print_summary
from deploy.status.report import Heard, rows_of
from deploy.status.show import audit_table, status_json
from deploy.status.show import status_table as process_table
from deploy.terminal.console import PlainConsole
from deploy.trace.info import complaints, link_table, print_lines, take
from glove_bridge.bridge import Bridge
from glove_bridge.patterns import load_patterns
from glove_bridge.patterns.pattern import PatternSet
from observer.console.scene import HandMap
from observer.console.swarm_view import SwarmView
from observer.link_stats import SwarmLinks
from shared.clock import NS_PER_S
from shared.codec import decode_on
from shared.config import load_scenario
from shared.formation import Formation, build_formation
from shared.memory_bus import MemoryBus, MemoryNetwork
from shared.scenario import Scenario
from shared.topics import ALIVE, parse_presence
from shared.transport import Arrival, Inbox

SEPARATOR = b"\n"
"""Between a key, without line breaks, and the payload on it."""
_ARRIVAL_NS = 5 * NS_PER_S
_OUTCOME = Outcome(
    seconds=1.0,
    unexpected_exits={},
    restarts={},
    failed_starts={},
    landed=True,
    stopped=(),
    interrupted=False,
    early=False,
    simulated=False,
    refused=(),
    referee={},
)


class _Everything(MemoryBus):
    """A bus on which whatever is said reaches everybody, as what is put on `**` does in Zenoh."""

    def __init__(self) -> None:
        super().__init__(MemoryNetwork())
        self.inboxes: list[Inbox] = []

    def subscribe(self, key_expression: str, inbox: Inbox) -> None:
        super().subscribe(key_expression, inbox)
        self.inboxes.append(inbox)


@cache
def _swarm() -> tuple[Scenario, Formation]:
    scenario = load_scenario("rhombus")
    return scenario, build_formation(scenario)


@cache
def _patterns() -> tuple[PatternSet, PatternSet]:
    return load_patterns("flight"), load_patterns("cues")


def _bridge() -> Bridge:
    return Bridge(*_swarm(), *_patterns(), epoch=0)


def hear(data: bytes) -> object:
    """What the launcher, the status, the console, the bridge and the statistics make of a payload on a key."""
    name, _, payload = data.partition(SEPARATOR)
    key = name.decode(errors="replace")
    scenario, formation = _swarm()
    arrivals = {key: [Arrival(payload, _ARRIVAL_NS)]}

    bus, links = _Everything(), SwarmLinks()
    monitor = Monitor(bus, formation, lambda: _ARRIVAL_NS)
    bus.inboxes[0].put(key, payload)
    monitor.drain()
    view = SwarmView(formation, HandMap(scenario, formation), {}, frozenset(), 0)
    said = [*view.take(arrivals, _ARRIVAL_NS), view.snapshot(_ARRIVAL_NS), view.health(_ARRIVAL_NS)]
    bridge = _bridge()
    bridge.receive(arrivals)
    bridge.step(_ARRIVAL_NS)
    take(links, key, payload, _ARRIVAL_NS)

    assert all(text.isprintable() for each in said for text in _texts(each)), said
    message = decode_on(key, payload)
    _show(monitor, links)
    return message


def hear_token(data: bytes) -> object:
    """What everybody who watches presence makes of a token that passed the bus."""
    token = parse_presence(data.decode(errors="replace"))
    scenario, formation = _swarm()
    monitor = Monitor(bus := _Everything(), formation, lambda: _ARRIVAL_NS)
    view = SwarmView(formation, HandMap(scenario, formation), {}, frozenset(), 0)
    bridge = _bridge()
    for present in (True, False, True):
        view.presence_changed(token, present)
        bridge.presence_changed(token, present, _ARRIVAL_NS)
        for watcher in bus.watchers:
            watcher(token, present)
        bridge.step(_ARRIVAL_NS)
        json.dumps(view.health(_ARRIVAL_NS))
    _show(monitor, SwarmLinks())
    assert ALIVE.format(role=token.partition("/")[0], id=int(token.partition("/")[2])).encode() == data
    return token


def _show(monitor: Monitor, links: SwarmLinks) -> None:
    """Shows what was heard wherever it can be shown; what comes out is text and line breaks."""
    out = StringIO()
    console = PlainConsole(file=out, width=200)
    tokens = {*monitor.present, *monitor.health}
    heard = {
        token: Heard(present=True, status=monitor.health[token].status if token in monitor.health else None)
        for token in tokens
    }
    rows = rows_of((), heard)
    agents = [AgentRow(id=i, state=state) for i, state in monitor.stats.latest.items()]
    summary = flight_summary(_OUTCOME, monitor, GloveChoice(uri="screen://", patterns="flight"))
    for shown in (
        status_table(agents, "flight"),
        process_table(rows, "status"),
        audit_table(rows) or "",
        link_table(links.rows(), links, _ARRIVAL_NS),
    ):
        console.print(shown)
    print_lines(console, complaints(links))
    print_summary(summary, console)
    json.dumps([summary, status_json(rows)])
    assert out.getvalue().replace("\n", "").isprintable(), out.getvalue()


def _texts(value: Any) -> Iterable[str]:
    """Yields every string of a JSON value."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from (*_texts(key), *_texts(item))
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _texts(item)
