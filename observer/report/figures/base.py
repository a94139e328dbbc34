"""What the figures of a report share: their shape, their style and the view from above."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.patches import Circle

from observer.colours import COLOURS, HAND, drone_colour
from observer.report.record import FlightRecord
from shared.recordings.track import Vec

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Columns = Mapping[str, Sequence[float] | Sequence[str] | Vec]
"""Column -> values, all of one length."""
Flights = Sequence[FlightRecord]
"""One flight or several; a figure of one flight shows the first."""

AXES = "xyz"
MOST_NAMED = len(COLOURS)
"""A legend names at most so many drones or links: then colours repeat."""

_STYLE: dict[Any, Any] = {
    "axes.prop_cycle": cycler(color=COLOURS),
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "font.size": 9.0,
    "svg.hashsalt": "swarmtouch",
    # Names are not ours: no dollar in one begins a formula.
    "text.parse_math": False,
}


class Drawing(NamedTuple):
    """One figure of the report.

    Attributes:
        name: Of its files.
        title: One line.
        about: What it shows, for the caption.
        size: Width and height, inches.
        draw: Draws it.
        columns: Returns the numbers that it shows.
        lacks: Returns what of it these flights do not have, None if it can be drawn.
    """

    name: str
    title: str
    about: str
    size: tuple[float, float]
    draw: "Callable[[Figure, Flights], None]"
    columns: Callable[[Flights], Columns]
    lacks: Callable[[Flights], str | None] = lambda _: None


@contextmanager
def style() -> Iterator[None]:
    """Draws in the report's style within the context."""
    with mpl.rc_context(_STYLE), warnings.catch_warnings():
        # Nor has our font every letter of them.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield


def components(name: str, values: Vec) -> dict[str, Vec]:
    """Returns (T, 3) as the columns `name_x`, `name_y`, `name_z`, m or m/s."""
    return {f"{name}_{axis}": values[:, column] for column, axis in enumerate(AXES)}


def snapshots(record: FlightRecord, count: int) -> list[int]:
    """Returns rows at equal horizontal distances along the way of the centroid, where everybody is known."""
    everybody = np.column_stack([record.mapped, record.position.reshape(len(record.t), -1)])
    there = np.flatnonzero(np.isfinite(everybody).all(axis=1))
    if not len(there):
        return []
    way = np.linalg.norm(np.diff(record.position[there, :, :2].mean(axis=1), axis=0), axis=1).cumsum()
    inner = np.searchsorted(way, np.linspace(0.0, way[-1], count)[1:-1]).tolist() if len(way) else []
    rows: list[int] = there[[0, *inner, len(way)]].tolist()
    return rows


def legend_beside(axes: "Axes") -> None:
    """Puts the legend where it covers nothing."""
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)


def draw_columns(axes: "Axes", record: FlightRecord) -> None:
    """Draws the columns and the zones around them in which avoidance acts, from above."""
    if not record.obstacles:
        return
    for number, column in enumerate(record.obstacles):
        label = "safety zone" if number == 0 else None
        zone = Circle((column.y, column.x), record.zones[number], fc="0.93", ec="0.75", lw=0.6, label=label)
        axes.add_patch(zone)
    across, along = zip(*((column.y, column.x) for column in record.obstacles), strict=True)
    axes.plot(across, along, ls="", marker="s", ms=4, color="0.35", label="column")


def draw_walkers(axes: "Axes", record: FlightRecord) -> None:
    """Draws the ways of what moved among the drones, from above."""
    for number, way in record.walkers.items():
        axes.plot(way[:, 1], way[:, 0], color="0.35", lw=1.2, ls=":", label=f"obstacle {number}")


def draw_paths(axes: "Axes", record: FlightRecord) -> None:
    """Draws the ways of the mapped hand and of every drone, from above."""
    axes.plot(record.mapped[:, 1], record.mapped[:, 0], color=HAND, lw=1.0, ls="--", label=record.hand_label)
    for index, drone in enumerate(record.ids):
        label = f"drone {drone}" if index < MOST_NAMED else None
        path = record.position[:, index]
        axes.plot(path[:, 1], path[:, 0], color=drone_colour(index), lw=1.0, alpha=0.8, label=label)


def frame_top_view(axes: "Axes", record: FlightRecord) -> None:
    """Shows the room as the operator sees it: forward (-x) is up, right (+y) is right."""
    shown = np.vstack([record.mapped, record.position.reshape(-1, 3)])
    low, high = np.nanmin(shown, axis=0) - 0.3, np.nanmax(shown, axis=0) + 0.3
    axes.set(
        xlim=(low[1], high[1]),
        ylim=(high[0], low[0]),
        aspect="equal",
        xlabel="y, m (right)",
        ylabel="x, m (forward is up)",
    )
    legend_beside(axes)
