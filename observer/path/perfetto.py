"""A path as Chrome-trace JSON with flow events, for ui.perfetto.dev and chrome://tracing. Pure."""

from collections.abc import Iterator
from typing import Any

from observer.path.hop import HAND_NODE, HandPath, Hop, Part

Event = dict[str, Any]

_STEPS, _LINKS = 1, 2
"""Threads of a node: what it does, and what is on its way to it."""
_INSTANT_US = 1.0


def chrome_trace(path: HandPath) -> dict[str, Any]:
    """Returns the JSON object; time is in microseconds since the sample, one process per node.

    Flow events lead from the step (or sample) that carried the sample to the step that used it.
    """
    nodes = {node: pid for pid, node in enumerate((HAND_NODE, *path.effects), start=1)}
    origin_ns = path.sample.stamp_ns
    events = [event for node, pid in nodes.items() for event in _names(node, pid)]
    events.append(_slice("sample", f"sample {path.number}", nodes[HAND_NODE], _STEPS, 0.0, _INSTANT_US))
    flow = 0
    for effect in path.effects.values():
        if effect.inputs:
            events += _step(effect.inputs[0], effect.pattern, nodes, origin_ns)
        for hop in effect.inputs:
            flow += 1
            events += _way(hop, flow, nodes, path)
    return {"traceEvents": events, "displayTimeUnit": "ms", "otherData": {"hand_sample": path.number}}


def _names(node: str, pid: int) -> Iterator[Event]:
    yield {"ph": "M", "name": "process_name", "pid": pid, "args": {"name": node}}
    yield {"ph": "M", "name": "process_sort_index", "pid": pid, "args": {"sort_index": pid}}
    for tid, name in ((_STEPS, "steps"), (_LINKS, "links")):
        yield {"ph": "M", "name": "thread_name", "pid": pid, "tid": tid, "args": {"name": name}}


def _step(hop: Hop, pattern: str, nodes: dict[str, int], origin_ns: int) -> Iterator[Event]:
    """Yields the waiting and the step of a node, once, by the hop that decided."""
    pid, parts = nodes[hop.listener], hop.parts_ns
    arrival, start = _us(hop.arrival_ns, origin_ns), _us(hop.start_ns, origin_ns)
    yield _slice("waiting", "waiting", pid, _STEPS, arrival, parts[Part.WAITING] / 1e3)
    length = max(parts[Part.COMPUTE] / 1e3, _INSTANT_US)
    yield _slice("compute", pattern or "step", pid, _STEPS, start, length)


def _way(hop: Hop, flow: int, nodes: dict[str, int], path: HandPath) -> Iterator[Event]:
    """Yields one hop on its way, and the arrow from the sender's step to the listener's."""
    origin_ns, parts, pid = path.sample.stamp_ns, hop.parts_ns, nodes[hop.listener]
    name = f"{hop.sender} to {hop.listener}"
    if hop.skipped:
        note = f"{hop.skipped} missed: {hop.cause}"
        sent = _us(hop.sent_ns, origin_ns)
        yield _slice("missed", f"{name}, {note}", pid, _LINKS + flow, sent, parts[Part.MISSED] / 1e3)
    used = _us(hop.used_ns, origin_ns)
    # A thread of its own: slices of one thread must not cross each other.
    yield _slice("transport", name, pid, _LINKS + flow, used, parts[Part.TRANSPORT] / 1e3)
    begin_ns = path.effects[hop.sender].inputs[0].start_ns if hop.sender in path.effects else origin_ns
    arrow = {"cat": "sample", "name": "sample", "id": flow}
    yield {"ph": "s", **arrow, "pid": nodes[hop.sender], "tid": _STEPS, "ts": _us(begin_ns, origin_ns)}
    yield {"ph": "f", "bp": "e", **arrow, "pid": pid, "tid": _STEPS, "ts": _us(hop.start_ns, origin_ns)}


def _slice(category: str, name: str, pid: int, tid: int, begin_us: float, length_us: float) -> Event:
    return {
        "ph": "X",
        "cat": category,
        "name": name,
        "pid": pid,
        "tid": tid,
        "ts": begin_us,
        "dur": max(0.0, length_us),
    }


def _us(stamp_ns: int, origin_ns: int) -> float:
    return (stamp_ns - origin_ns) / 1e3
