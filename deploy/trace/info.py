"""`swarmtouch trace info`: what is in a trace, or what a running swarm says now, one row per link."""

import json
import math
import time
from collections.abc import Iterable, Mapping

import attrs
from rich import box
from rich.console import Console
from rich.live import Live
from rich.table import Table

from deploy.terminal.console import open_console
from deploy.trace.listen import listen
from observer.link_stats import LinkSummary, SwarmLinks
from observer.swarm import running_scenario
from observer.trace.read import Trace, open_trace
from shared.clock import NS_PER_S, system_clock
from shared.codec import decode_on
from shared.errors import DecodeError
from shared.nodes import OBSERVER
from shared.plain_text import plain
from shared.process import prepare_process
from shared.topics import TOPICS

_PERIOD_S = 0.5
_HOUR_NS = 3600 * NS_PER_S
_MOST_HOURS = 1000
"""Of so many different hours a trace is looked at."""
_WIDTH = 110
"""Where there is no terminal to fit into."""
_COLUMNS = (
    *("messages", "rate\nHz", "jitter\nms", "missing", "late", "age p50\nms", "age p99\nms", "silent\ns"),
    "rejected",
)


def main(*, run: str | None, live: bool, links: bool, seconds: float | None, as_json: bool) -> int:
    """Shows the links; returns the exit code, 1 if nothing was heard."""
    console = open_console(stderr=False)
    if not console.is_terminal:
        console.width = _WIDTH
    if live:
        swarm, now_ns = _hear(run, seconds, console, everybody=links)
    else:
        trace = open_trace(run)
        swarm, times = _read(trace)
        begin_ns, now_ns, elsewhere = times.span()
        if not as_json:
            print_lines(console, _describe(trace, (now_ns - begin_ns) / NS_PER_S, elsewhere))
    rows = _chosen(swarm, everybody=links)
    if as_json:
        for row in rows:
            print(json.dumps({**attrs.asdict(row), "rejected": swarm.rejected[row.key]}))
    else:
        console.print(link_table(rows, swarm, now_ns))
        print_lines(console, complaints(swarm))
    return 0 if rows else 1


def take(swarm: SwarmLinks, key: str, payload: bytes, arrival_ns: int) -> None:
    """Counts one payload, be it a message or not."""
    try:
        swarm.add(key, decode_on(key, payload), arrival_ns)
    except DecodeError as error:
        swarm.reject(key, error.reason)


def link_table(rows: Iterable[LinkSummary], swarm: SwarmLinks, now_ns: int) -> Table:
    """Draws the links; `silent` is the time since the last sample."""
    table = Table(box=box.SIMPLE_HEAD, padding=0)
    for column in ("key", "heard by"):
        table.add_column(column, no_wrap=True)
    for column in _COLUMNS:
        table.add_column(column, justify="left" if column == "rejected" else "right")
    for row in rows:
        refused = _counts(swarm.rejected[row.key]) if row.listener == OBSERVER else ""
        table.add_row(
            row.key,
            row.listener,
            str(row.messages),
            f"{row.rate_hz:.1f}",
            _ms(row.jitter_ms),
            str(row.missing),
            str(row.late),
            _ms(row.age_ms.p50),
            _ms(row.age_ms.p99),
            f"{max(0, now_ns - row.last_ns) / NS_PER_S:.1f}" if row.last_ns else "-",
            refused,
        )
    return table


def complaints(swarm: SwarmLinks) -> list[str]:
    """Says what the processes themselves have rejected, one line for each that has."""
    return [
        f"{name} has rejected: {_counts(status.rejected)}"
        for name, status in sorted(swarm.processes.items())
        if any(status.rejected.values())
    ]


def print_lines(console: Console, lines: Iterable[str]) -> None:
    """Prints lines as long as they are."""
    for line in lines:
        console.print(line, soft_wrap=True)


class _Times:
    """When most of what is in a trace came: a damaged stamp may be centuries off."""

    def __init__(self) -> None:
        self._hours: dict[int, tuple[int, int, int]] = {}
        self._count = 0

    def add(self, log_ns: int) -> None:
        """Takes in when something came, ns."""
        self._count += 1
        hour = log_ns // _HOUR_NS
        if hour in self._hours or len(self._hours) < _MOST_HOURS:
            count, first_ns, last_ns = self._hours.get(hour, (0, log_ns, log_ns))
            self._hours[hour] = (count + 1, min(first_ns, log_ns), max(last_ns, log_ns))

    def span(self) -> tuple[int, int, int]:
        """Returns first and last time about the fullest hour, ns, and how many came in no hour next to it."""
        if not self._hours:
            return 0, 0, 0
        low = high = max(self._hours, key=lambda hour: self._hours[hour][0])
        while low - 1 in self._hours:
            low -= 1
        while high + 1 in self._hours:
            high += 1
        within = sum(self._hours[hour][0] for hour in range(low, high + 1))
        return self._hours[low][1], self._hours[high][2], self._count - within


def _read(trace: Trace) -> tuple[SwarmLinks, _Times]:
    """Returns the links, and when what is there came."""
    swarm, times = SwarmLinks(), _Times()
    for record in trace.records():
        take(swarm, record.key, record.payload, record.log_ns)
        times.add(record.log_ns)
    return swarm, times


def _hear(
    source: str | None, seconds: float | None, console: Console, *, everybody: bool
) -> tuple[SwarmLinks, int]:
    """Listens until Ctrl-C or for a while, with a table on a terminal; returns the links and the time, ns."""
    scenario, swarm, clock = running_scenario(source), SwarmLinks(), system_clock()
    stopping = prepare_process("info")
    end = time.monotonic() + (math.inf if seconds is None else seconds)
    with Live(console=console, auto_refresh=False, transient=True) as view:
        for batch in listen(scenario, [topic.wildcard for topic in TOPICS], clock, stopping, _PERIOD_S):
            for key, arrival in batch:
                take(swarm, key, *arrival)
            if console.is_terminal:
                view.update(link_table(_chosen(swarm, everybody=everybody), swarm, clock()), refresh=True)
            if time.monotonic() >= end:
                break
    return swarm, clock()


def _chosen(swarm: SwarmLinks, *, everybody: bool) -> list[LinkSummary]:
    return [row for row in swarm.rows() if everybody or row.listener == OBSERVER]


def _describe(trace: Trace, seconds: float, elsewhere: int) -> list[str]:
    host, versions = trace.metadata.get("host", {}), trace.metadata.get("versions", {})
    return [
        *(f"{file}: {file.stat().st_size / 1e6:.1f} MB" for file in trace.files),
        f"swarm {trace.scenario.swarm.name}, {seconds:.1f} s, recorded on {host.get('name', '?')}"
        f" by swarmtouch {versions.get('swarmtouch', '?')}",
        *trace.faults,
        *([f"{elsewhere} messages came at a time that is hours away from all others"] if elsewhere else []),
    ]


def _counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{plain(reason)} {count}" for reason, count in sorted(counts.items()) if count)


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
