"""A path as a space-time diagram: one line per node, time to the right, every hop a slope. Pure."""

import math
from collections.abc import Iterator
from html import escape

from observer.colours import COLOURS, HAND
from observer.path.hop import GLOVE_NODE, HAND_NODE, Effect, HandPath, Hop, Part
from shared.plain_text import plain

_WIDTH, _LEFT, _RIGHT = 960, 90, 110
_TOP, _LANE, _BAR = 76, 58, 14
"""Space above the first line, between lines, and height of a bar, px."""
_WAIT, _STEP, _SLOPE, _MISSED = "#cfd8dc", COLOURS[0], COLOURS[1], COLOURS[4]
_LONGEST_MS = 250.0
"""What comes later (usually a pattern) is cut off and said in words."""
_TICKS = 8


def draw_diagram(path: HandPath) -> str:
    """Returns the picture as SVG; slopes that decided are bold, numbers are milliseconds since the sample."""
    return _Diagram(path).svg()


class _Diagram:
    def __init__(self, path: HandPath) -> None:
        self._path = path
        self._lanes = {node: i for i, node in enumerate((HAND_NODE, *path.effects))}
        drones = [path.latency_ns(node) / 1e6 for node in path.effects if node != GLOVE_NODE]
        longest = max((ms for ms in (*drones, self._glove_ms()) if ms <= _LONGEST_MS), default=1.0)
        self._ms = 1.04 * max(longest, 0.1)

    def svg(self) -> str:
        height = _TOP + _LANE * len(self._lanes) + 30
        return "\n".join(
            (
                f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH}" height="{height}"'
                f' viewBox="0 0 {_WIDTH} {height}" font-family="sans-serif" font-size="12">',
                '<rect width="100%" height="100%" fill="white"/>',
                f'<text x="8" y="20" font-size="15">hand sample {self._path.number} through the swarm</text>',
                *self._key(),
                *self._grid(height - 30),
                *(line for effect in self._path.effects.values() for line in self._hops(effect)),
                *(line for effect in self._path.effects.values() for line in self._bars(effect)),
                "</svg>\n",
            )
        )

    def _glove_ms(self) -> float:
        return self._path.latency_ns(GLOVE_NODE) / 1e6 if GLOVE_NODE in self._path.effects else math.inf

    def _key(self) -> Iterator[str]:
        entries = (("transport", _SLOPE), ("missed", _MISSED), ("waiting", _WAIT), ("compute", _STEP))
        for i, (name, colour) in enumerate(entries):
            x = _LEFT + 110 * i
            yield f'<rect x="{x}" y="34" width="18" height="10" fill="{colour}"/>'
            yield f'<text x="{x + 24}" y="43">{name}</text>'
        yield f'<path d="M{_LEFT + 440} 39h18" stroke="#aaa" stroke-dasharray="4 3"/>'
        yield f'<text x="{_LEFT + 464}" y="43">heard, did not decide</text>'

    def _grid(self, bottom: int) -> Iterator[str]:
        step = _round_step(self._ms / _TICKS)
        for i in range(math.floor(self._ms / step) + 1):
            x = self._x(i * step * 1e6)
            yield f'<path d="M{x:.1f} {_TOP - 14}V{bottom}" stroke="#eee"/>'
            yield f'<text x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{i * step:g}</text>'
        yield f'<text x="8" y="{bottom + 16}">time, ms</text>'
        for node, lane in self._lanes.items():
            y = _TOP + lane * _LANE
            yield f'<text x="8" y="{y + 4}" font-weight="bold">{escape(node)}</text>'
            yield f'<path d="M{_LEFT} {y}H{_WIDTH - _RIGHT}" stroke="#999"/>'
        yield f'<circle cx="{_LEFT}" cy="{_TOP}" r="5" fill="{HAND}"/>'

    def _hops(self, effect: Effect) -> Iterator[str]:
        for i, hop in enumerate(effect.inputs):
            if self._fits(hop):
                yield from self._slope(hop, decided=i == 0)

    def _slope(self, hop: Hop, *, decided: bool) -> Iterator[str]:
        above, below = self._y(hop.sender), self._y(hop.listener)
        sent, used, arrival = (self._x(self._since(t)) for t in (hop.sent_ns, hop.used_ns, hop.arrival_ns))
        if hop.skipped:
            yield (
                f'<path d="M{sent:.1f} {above + 9}H{used:.1f}" stroke="{_MISSED}" stroke-width="5">'
                f"<title>{hop.skipped} missed, {hop.cause}</title></path>"
            )
        look = f'stroke="{_SLOPE}" stroke-width="2.2"' if decided else 'stroke="#aaa" stroke-dasharray="4 3"'
        title = f"{hop.sender} to {hop.listener}: {hop.parts_ns[Part.TRANSPORT] / 1e6:.3f} ms"
        yield (
            f'<path d="M{used:.1f} {above}L{arrival:.1f} {below}" {look} fill="none">'
            f"<title>{escape(title)}</title></path>"
        )

    def _bars(self, effect: Effect) -> Iterator[str]:
        y = self._y(effect.node)
        late_ms = self._path.latency_ns(effect.node) / 1e6
        text = f"{late_ms:.2f} ms" + (f", {plain(effect.pattern)}" if effect.pattern else "")
        if not effect.inputs or not self._fits(effect.inputs[0]):
            yield f'<text x="{_WIDTH - _RIGHT - 8}" y="{y - 6}" text-anchor="end">later: {escape(text)}</text>'
            return
        hop = effect.inputs[0]
        arrival, start, done = (self._x(self._since(t)) for t in (hop.arrival_ns, hop.start_ns, hop.done_ns))
        for begin, end, colour in ((arrival, start, _WAIT), (start, done, _STEP)):
            size = f'width="{max(end - begin, 1.0):.1f}" height="{_BAR}"'
            yield f'<rect x="{begin:.1f}" y="{y - _BAR / 2}" {size} fill="{colour}"/>'
        yield f'<text x="{done + 6:.1f}" y="{y - 10}">{escape(text)}</text>'

    def _fits(self, hop: Hop) -> bool:
        return self._since(hop.done_ns) / 1e6 <= self._ms

    def _since(self, stamp_ns: int) -> int:
        return stamp_ns - self._path.sample.stamp_ns

    def _x(self, since_ns: float) -> float:
        return _LEFT + (_WIDTH - _LEFT - _RIGHT) * since_ns / 1e6 / self._ms

    def _y(self, node: str) -> int:
        return _TOP + self._lanes[node] * _LANE


def _round_step(ms: float) -> float:
    """Returns 1, 2 or 5 times a power of ten, not below `ms`."""
    power = 10.0 ** math.floor(math.log10(ms))
    return next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= ms)
