"""Which pattern was felt when, beside the area of the formation."""

from collections import Counter
from typing import TYPE_CHECKING

from observer.colours import COLOURS, HAND
from observer.report.figures.base import Columns, Drawing, Flights
from observer.report.tables import areas

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_PATTERNS = 40
"""No set has more; of more, the most frequent are drawn."""
SHORTEST_BAR = 0.15
"""A pattern is drawn at least so long, s, or one would not see it."""


def _draw(figure: "Figure", flights: Flights) -> None:
    record = flights[0]
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1, 1))
    above.plot(record.recorded_t, areas(record) / record.default_area, color=COLOURS[0], lw=1.1)
    above.axhline(1.0, color=HAND, lw=0.9, ls="--")
    above.set_ylabel("area / default area")
    counts = Counter(pattern.name for pattern in record.patterns)
    names = sorted(name for name, _ in counts.most_common(MOST_PATTERNS))
    for row, name in enumerate(names):
        bars = [(p.t, max(p.length, SHORTEST_BAR)) for p in record.patterns if p.name == name]
        below.broken_barh(bars, (row - 0.35, 0.7), color=COLOURS[row % len(COLOURS)])
    below.set(
        xlabel="time, s",
        ylabel="pattern",
        yticks=range(len(names)),
        yticklabels=names,
        xlim=(0.0, record.recorded_t[-1]),
    )
    below.invert_yaxis()


def _columns(flights: Flights) -> Columns:
    patterns = flights[0].patterns
    return {
        "t": [pattern.t for pattern in patterns],
        "pattern": [pattern.name for pattern in patterns],
        "length": [pattern.length for pattern in patterns],
    }


TIMELINE = Drawing(
    name="patterns",
    title="Tactile patterns",
    about="Above, the area of the polygon of the drones over that of the undisturbed formation (dashed); below,"
    " what the operator felt.",
    size=(8.0, 4.2),
    draw=_draw,
    columns=_columns,
    lacks=lambda flights: None if flights[0].patterns else "no pattern was played in this flight",
)
