"""Mapped hand, goal, set-point and body of the first drone."""

from typing import TYPE_CHECKING

from observer.colours import COLOURS, HAND
from observer.report.figures.base import AXES, Columns, Drawing, Flights, components, legend_beside

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw(figure: "Figure", flights: Flights) -> None:
    record = flights[0]
    curves = (
        (record.hand_label, record.mapped, {"color": HAND, "ls": "--", "zorder": 3}),
        ("goal", record.goal[:, 0], {"color": COLOURS[4], "lw": 2.2}),
        ("set-point", record.setpoint[:, 0], {"color": COLOURS[2]}),
        ("actual", record.position[:, 0], {"color": COLOURS[0]}),
    )
    panels = figure.subplots(3, 1, sharex=True)
    for column, panel in enumerate(panels):
        for label, values, look in curves:
            panel.plot(record.t, values[:, column], label=label, **{"lw": 1.0, **look})
        panel.set_ylabel(f"{AXES[column]}, m")
    legend_beside(panels[0])
    panels[-1].set_xlabel("time, s")
    figure.suptitle(f"drone {record.ids[0]}")


def _columns(flights: Flights) -> Columns:
    record = flights[0]
    return {
        "t": record.t,
        **components("hand", record.hand),
        **components("mapped", record.mapped),
        **components("goal", record.goal[:, 0]),
        **components("setpoint", record.setpoint[:, 0]),
        **components("actual", record.position[:, 0]),
    }


TRACKING = Drawing(
    name="tracking",
    title="Hand, goal and actual position of the first drone",
    about="Where the hand puts the formation, where the control law wants the drone (before avoidance), what it"
    " was told (after avoidance and limits) and where it was.",
    size=(8.0, 5.4),
    draw=_draw,
    columns=_columns,
)
