"""Hand velocity, and the impedance displacement that follows from it."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from observer.report.figures.base import AXES, MOST_NAMED, Columns, Drawing, Flights, components, legend_beside
from shared.recordings.track import Vec

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ONE_PANEL = 2.6
"""Height without impedance, inches."""
_ALIKE = 2e-3
"""Displacements that differ by less are drawn as one, m."""


def _draw(figure: "Figure", flights: Flights) -> None:
    record = flights[0]
    has_links = bool(record.displacement)
    if not has_links:
        figure.set_figheight(_ONE_PANEL)
    panels = figure.subplots(3 if has_links else 1, 1, sharex=True, squeeze=False)[:, 0]
    for column, axis in enumerate(AXES):
        panels[0].plot(record.t, record.hand_velocity[:, column], lw=0.9, label=f"along {axis}")
    panels[0].set_ylabel("hand velocity, m/s")
    groups = _alike(record.displacement)
    for column, panel in enumerate(panels[1:]):
        for links, values in groups[:MOST_NAMED]:
            label = f"all {len(links)} links" if len(groups) == 1 else f"link {', '.join(links)}"
            panel.plot(record.t, values[:, column], lw=1.1, label=label)
        panel.set_ylabel(f"displacement\nalong {AXES[column]}, m")
    for panel in panels[:2]:
        legend_beside(panel)
    panels[-1].set_xlabel("time, s")


def _alike(displacement: Mapping[str, Vec]) -> list[tuple[list[str], Vec]]:
    """Groups links that give way alike: those with the same parameters."""
    groups: list[tuple[list[str], Vec]] = []
    for link, values in displacement.items():
        alike = (group for group in groups if np.allclose(group[1], values, atol=_ALIKE, equal_nan=True))
        group = next(alike, None)
        if group is None:
            groups.append(([link], values))
        else:
            group[0].append(link)
    return groups


def _columns(flights: Flights) -> Columns:
    record = flights[0]
    columns = {"t": record.t, **components("hand_velocity", record.hand_velocity)}
    for link, values in record.displacement.items():
        columns |= components(f"displacement_{link}", values)
    return columns


HAND_MOTION = Drawing(
    name="hand_motion",
    title="Hand velocity and impedance displacement",
    about="The hand's velocity in the world frame and, where the impedance was on, how far each link gave way"
    " (formation frame, before its limit). Links that give way alike are one curve.",
    size=(8.0, 5.4),
    draw=_draw,
    columns=_columns,
)
