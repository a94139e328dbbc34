"""A flown formation from above, drawn with matplotlib (the extra `plot`)."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from deploy.lockstep.record import Record
from observer.colours import COLOURS, HAND, drone_colour
from shared.cylinders import columns_of
from shared.errors import ConfigError
from shared.fence import fence_box
from shared.files import writing
from shared.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SNAPSHOTS = 4
"""How often the whole formation is drawn along the way."""


def draw(record: Record, scenario: Scenario, path: Path) -> None:
    """Draws trajectories, snapshots of the formation with its references, hand, columns and fence.

    Args:
        record: The run.
        scenario: What was flown.
        path: Where to write; the suffix chooses the format (`.png`, `.svg`, `.pdf`), without one it is PNG.

    Raises:
        ConfigError: matplotlib is not installed, it does not know the format, or the file cannot be written.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415  an optional extra, and slow to import
    except ImportError as error:
        raise ConfigError("--plot needs matplotlib: install the extra, for example swarmtouch[plot]") from error
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    axes = figure.add_subplot()
    _draw_room(axes, record, scenario)
    _draw_paths(axes, record)
    for tick in np.linspace(0, len(record.hand.t) - 1, SNAPSHOTS).astype(int):
        _draw_formation(axes, record, tick, strength=0.3 + 0.7 * tick / len(record.hand.t))
    _frame(axes, record, scenario)
    try:
        # Left to itself matplotlib writes to a file of another name where there is no suffix.
        with writing(path):
            figure.savefig(path, dpi=110, format=path.suffix[1:] or "png")
    except ValueError as error:
        raise ConfigError(f"--plot {path}: {error}") from error


def _draw_room(axes: "Axes", record: Record, scenario: Scenario) -> None:
    from matplotlib.patches import Circle, Rectangle  # noqa: PLC0415

    low, high = fence_box(scenario, record.formation)
    axes.add_patch(
        Rectangle((low[1], low[0]), high[1] - low[1], high[0] - low[0], fill=False, ls=":", ec="0.5")
    )
    for column in columns_of(scenario):
        axes.add_patch(Circle((column.y, column.x), column.radius, fc="0.8", ec="0.5"))


def _draw_paths(axes: "Axes", record: Record) -> None:
    hand = record.hand.point
    axes.plot(hand[:, 1], hand[:, 0], color=HAND, lw=1.2, ls="--", label="hand")
    for row, drone in enumerate(record.formation.ids):
        x, y = record.position[:, row, 0], record.position[:, row, 1]
        axes.plot(y, x, color=drone_colour(row), lw=1.0, alpha=0.7, label=f"drone {drone}")


def _draw_formation(axes: "Axes", record: Record, tick: int, strength: float) -> None:
    places = np.vstack([record.hand.point[tick], record.position[tick]])
    for row, weights in enumerate(record.formation.weights):
        for reference in (column for column, weight in weights.items() if weight):
            ends = places[[reference, row + 1]]
            axes.plot(ends[:, 1], ends[:, 0], color="0.35", lw=1.0, alpha=strength, zorder=3)
    axes.scatter(places[0, 1], places[0, 0], marker="*", s=90, color=HAND, alpha=strength, zorder=4)
    colours = [drone_colour(row) for row in range(len(places) - 1)]
    axes.scatter(places[1:, 1], places[1:, 0], s=45, c=colours, ec="white", lw=0.8, alpha=strength, zorder=5)


def _frame(axes: "Axes", record: Record, scenario: Scenario) -> None:
    shown = np.vstack([record.hand.point, record.position.reshape(-1, 3)])
    low, high = shown.min(axis=0) - 0.3, shown.max(axis=0) + 0.3
    # Seen as the operator sees it: forward (-x) is up, right (+y) is right.
    axes.set(
        xlim=(low[1], high[1]),
        ylim=(high[0], low[0]),
        aspect="equal",
        xlabel="y, m (right)",
        ylabel="x, m (forward is up)",
        title=f"{scenario.swarm.name}, {scenario.swarm.law} law, {record.hand.t[-1]:.0f} s",
    )
    axes.grid(visible=True, lw=0.4, alpha=0.5)
    if len(record.formation.ids) <= len(COLOURS):
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
