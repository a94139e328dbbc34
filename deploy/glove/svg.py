"""Draws a pattern set as an SVG picture: one row of five fingers over time per pattern."""

from xml.sax.saxutils import escape

from glove_bridge.patterns.pattern import Pattern, PatternSet
from glove_bridge.patterns.schema import FINGERS, HIGHEST_HZ

_PX_PER_MS = 0.25
_FINGER, _GAP, _TOP, _LEFT = 12, 26, 34, 120
"""Height of a finger's line, space between patterns, space above them and to their left, px."""
_BLOCK = _FINGER * len(FINGERS) + _GAP


def draw_svg(patterns: PatternSet) -> str:
    """Returns the picture; darker is stronger, every bar says its frequency on hovering."""
    longest = max(pattern.length_ms for pattern in patterns.patterns.values())
    width = _LEFT + longest * _PX_PER_MS + 20
    height = _TOP + _BLOCK * len(patterns.patterns)
    rows = "\n".join(_row(p, _TOP + k * _BLOCK) for k, p in enumerate(patterns.patterns.values()))
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height}"'
            ' font-family="sans-serif" font-size="11">',
            '<rect width="100%" height="100%" fill="white"/>',
            f'<text x="8" y="18" font-size="13">{escape(patterns.name)}: {escape(patterns.about)}</text>',
            rows,
            "</svg>\n",
        )
    )


def _row(pattern: Pattern, top: int) -> str:
    lines = [
        f'<text x="8" y="{top + 14}" font-weight="bold">{escape(pattern.name)}</text>',
        f'<text x="8" y="{top + 30}">{pattern.length_ms} ms</text>',
    ]
    for finger in FINGERS:
        y = top + (finger - 1) * _FINGER
        end = _LEFT + pattern.length_ms * _PX_PER_MS
        lines.append(f'<text x="{_LEFT - 12}" y="{y + 9}">{finger}</text>')
        lines.append(f'<path d="M{_LEFT} {y + 5.5}H{end:g}" stroke="#ccc"/>')
    start_ms = 0
    for frame in pattern.frames:
        for finger, hz in sorted(frame.hz.items()):
            x, y = _LEFT + start_ms * _PX_PER_MS, top + (finger - 1) * _FINGER
            lines.append(
                f'<rect x="{x:g}" y="{y}" width="{frame.ms * _PX_PER_MS:g}" height="{_FINGER - 1}"'
                f' fill="#1f4e8c" fill-opacity="{(hz / HIGHEST_HZ) ** 2:.2f}"><title>{hz:g} Hz</title></rect>'
            )
        start_ms += frame.ms
    return "\n".join(lines)
