"""`swarmtouch trace path`: one hand sample on its way through the swarm."""

import json
import time
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from deploy.terminal.console import open_console
from observer.path.diagram import draw_diagram
from observer.path.flight import RecordedFlight
from observer.path.follow import Excess, Typical, follow, most_unusual, typical
from observer.path.hop import GLOVE_NODE, Effect, HandPath, Hop, Part
from observer.path.perfetto import chrome_trace
from observer.trace.read import open_trace
from shared.clock import NS_PER_S
from shared.files import writing
from shared.formation import build_formation

_WIDTH = 110
"""Where there is no terminal to fit into."""


def main(*, number: int, run: Path, perfetto: Path | None, svg: Path | None) -> int:
    """Shows the way of one sample; returns the exit code, 1 if it came to nobody."""
    trace = open_trace(run)
    flight = RecordedFlight(build_formation(trace.scenario), (message for _, message in trace.all_messages()))
    path, usual = follow(flight, number), typical(flight)
    console = open_console(stderr=False)
    if not console.is_terminal:
        console.width = _WIDTH
    console.print(f"hand sample {number}, sent at {_clock(path.sample.stamp_ns)}, {path.sample.mode}")
    console.print(path_table(path, usual))
    for line in (*remarks(path, most_unusual(path, usual)), *trace.faults):
        console.print(line)
    if perfetto is not None:
        _write(perfetto, json.dumps(chrome_trace(path)), console)
    if svg is not None:
        _write(svg, draw_diagram(path), console)
    return 0 if path.effects else 1


def path_table(path: HandPath, usual: Typical) -> Table:
    """Returns one row per hop; those that decided are bold, and their times add up along a way."""
    table = Table(box=box.SIMPLE_HEAD, padding=0, caption="ms (median of the flight); bold: what decided")
    table.add_column("hop", no_wrap=True)
    for name in (*(part.value for part in Part), "sum", "since sample"):
        table.add_column(name, justify="right", no_wrap=True)
    for effect in path.effects.values():
        for hop in effect.inputs:
            decided = hop is effect.inputs[0]
            cells = [_cell(hop, part, usual if decided else {}) for part in Part]
            since = _ms(path.latency_ns(effect.node)) if decided else ""
            name = f"{hop.sender} -> {_target(effect)}"
            table.add_row(name, *cells, _ms(hop.total_ns), since, style="bold" if decided else "dim")
    return table


def remarks(path: HandPath, unusual: Excess | None) -> list[str]:
    """Says in words what the table does not."""
    lines = [f"{hop.sender} -> {hop.listener}: {_missed(hop)}" for hop in _deciding(path) if hop.skipped]
    for effect in path.effects.values():
        if effect.lacked:
            lines.append(f"{effect.node} stepped without {', '.join(effect.lacked)}")
        if effect.number > path.number:
            lines.append(f"{effect.node}: sample {effect.number} came through first")
        if effect.directly_ns < effect.done_ns:
            early = _ms(effect.directly_ns - path.sample.stamp_ns)
            lines.append(f"{effect.node}: its first step with the hand's velocity was at {early} ms")
    if GLOVE_NODE not in path.effects:
        lines.append("glove: no pattern began within a second")
    if unusual is not None and unusual.excess_ns > 0:
        hop, part, excess_ns = unusual
        lines.append(
            f"most unusual: {part} {hop.sender} -> {hop.listener}, {_ms(excess_ns)} ms above its median"
        )
    return lines


def _deciding(path: HandPath) -> list[Hop]:
    return [effect.inputs[0] for effect in path.effects.values() if effect.inputs]


def _target(effect: Effect) -> str:
    return f"{effect.node} {effect.pattern}".strip()


def _missed(hop: Hop) -> str:
    messages = "message went" if hop.skipped == 1 else "messages went"
    return f"{hop.skipped} {messages} by: {hop.cause}"


def _cell(hop: Hop, part: Part, usual: Typical) -> str:
    median = usual.get((hop.sender, hop.listener, part))
    took = _ms(hop.parts_ns[part])
    return took if median is None else f"{took} ({_ms(median)})"


def _ms(ns: float) -> str:
    return f"{ns / 1e6:.3f}"


def _clock(stamp_ns: int) -> str:
    seconds, rest = divmod(stamp_ns, NS_PER_S)
    return f"{time.strftime('%H:%M:%S', time.localtime(seconds))}.{rest // 1_000_000:03d}"


def _write(path: Path, text: str, console: Console) -> None:
    with writing(path):
        path.write_text(text, encoding="utf-8")
    console.print(str(path))
