"""The flight from above: columns, safety zones, ways, and the shape of the formation along them."""

from typing import TYPE_CHECKING

from matplotlib.patches import Polygon

from observer.report.figures.base import (
    Columns,
    Drawing,
    Flights,
    components,
    draw_columns,
    draw_paths,
    draw_walkers,
    frame_top_view,
    snapshots,
)
from shared.geometry import hull

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SNAPSHOTS = 8


def _draw(figure: "Figure", flights: Flights) -> None:
    record = flights[0]
    axes = figure.add_subplot()
    draw_columns(axes, record)
    draw_walkers(axes, record)
    draw_paths(axes, record)
    for row in snapshots(record, SNAPSHOTS):
        corners = hull((y, x) for x, y in record.position[row, :, :2].tolist())
        axes.add_patch(Polygon(corners, fc=(0.2, 0.2, 0.2, 0.08), ec="0.3", lw=1.0, zorder=3))
    frame_top_view(axes, record)


def _columns(flights: Flights) -> Columns:
    record = flights[0]
    columns = {"t": record.t, **components("mapped", record.mapped)}
    for index, drone in enumerate(record.ids):
        columns |= components(f"drone_{drone}", record.position[:, index])
    for number, way in record.walkers.items():
        columns |= components(f"obstacle_{number}", way)
    return columns


TOP_VIEW = Drawing(
    name="top_view",
    title="The flight from above",
    about="Columns and the zones around them in which avoidance acts, the ways of the mapped hand, of the"
    " drones and of what moved among them, and the polygon of the formation at equal distances along its way."
    " Seen as the operator sees it.",
    size=(8.0, 6.5),
    draw=_draw,
    columns=_columns,
)
