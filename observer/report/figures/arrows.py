"""The formation along the way, with an arrow from each reference to who refers to it."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patheffects import withStroke

from observer.colours import HAND, drone_colour
from observer.report.figures.base import Columns, Drawing, Flights, draw_paths, frame_top_view, snapshots
from observer.report.record import FlightRecord

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SNAPSHOTS = 5


def _draw(figure: "Figure", flights: Flights) -> None:
    record = flights[0]
    axes = figure.add_subplot()
    draw_paths(axes, record)
    for line in axes.get_lines():
        line.set_alpha(0.35)
    for row in snapshots(record, SNAPSHOTS):
        for _, drone, begin, end in _arrows(record, row):
            look = {"arrowstyle": "-|>", "color": drone_colour(drone), "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", xy=(end[1], end[0]), xytext=(begin[1], begin[0]), arrowprops=look, zorder=3)
        y, x = record.mapped[row, 1], record.mapped[row, 0]
        axes.plot(y, x, marker="*", ms=9, color=HAND, zorder=4)
        label = axes.annotate(f"{record.t[row]:.0f} s", (y, x), (7, -12), textcoords="offset points", zorder=5)
        label.set_path_effects([withStroke(linewidth=3.0, foreground="white")])
    frame_top_view(axes, record)


def _arrows(record: FlightRecord, row: int) -> Iterator[tuple[int, int, list[float], list[float]]]:
    """Yields reference (0 is the hand), index of the drone, and both ends (x, y, z) of every arrow."""
    places = np.vstack([record.mapped[row], record.position[row]]).tolist()
    for drone, weights in enumerate(record.formation.weights):
        for reference in (column for column, weight in weights.items() if weight):
            yield reference, drone, places[reference], places[drone + 1]


def _columns(flights: Flights) -> Columns:
    record = flights[0]
    rows = [
        (record.t[row], "hand" if not reference else str(record.ids[reference - 1]), drone, begin, end)
        for row in snapshots(record, SNAPSHOTS)
        for reference, drone, begin, end in _arrows(record, row)
    ]
    return {
        "t": [t for t, *_ in rows],
        "from": [reference for _, reference, *_ in rows],
        "to": [str(record.ids[drone]) for _, _, drone, *_ in rows],
        **{f"from_{axis}": [begin[k] for *_, begin, _ in rows] for k, axis in enumerate("xy")},
        **{f"to_{axis}": [end[k] for *_, end in rows] for k, axis in enumerate("xy")},
    }


ARROWS = Drawing(
    name="formation",
    title="The formation along the way",
    about="At equal distances along the way, an arrow from each reference to the drone that refers to it; the"
    " star is the mapped hand. Seen from above as the operator sees it.",
    size=(8.0, 6.0),
    draw=_draw,
    columns=_columns,
)
