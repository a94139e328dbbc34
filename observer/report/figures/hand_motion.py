"""Hand velocity, and the impedance displacement that follows from it."""

from typing import TYPE_CHECKING

from observer.report.figures.base import AXES, MOST_NAMED, Columns, Drawing, Flights, components, legend_beside

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ONE_PANEL = 2.6
"""Height without impedance, inches."""


def _draw(figure: "Figure", flights: Flights) -> None:
    record = flights[0]
    has_links = bool(record.displacement)
    if not has_links:
        figure.set_figheight(_ONE_PANEL)
    panels = figure.subplots(3 if has_links else 1, 1, sharex=True, squeeze=False)[:, 0]
    for column, axis in enumerate(AXES):
        panels[0].plot(record.t, record.hand_velocity[:, column], lw=0.9, label=f"along {axis}")
    panels[0].set_ylabel("hand velocity, m/s")
    for column, panel in enumerate(panels[1:]):
        for index, (link, values) in enumerate(record.displacement.items()):
            label = f"link {link}" if index < MOST_NAMED else None
            # Links with the same parameters lie on each other: widths show all of them.
            panel.plot(record.t, values[:, column], lw=max(1.0, 4.0 - index), label=label)
        panel.set_ylabel(f"displacement\nalong {AXES[column]}, m")
    for panel in panels[:2]:
        legend_beside(panel)
    panels[-1].set_xlabel("time, s")


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
    " (formation frame, before its limit). Links with equal parameters give way alike.",
    size=(8.0, 5.4),
    draw=_draw,
    columns=_columns,
)
