"""How often the operator moved as a pattern advised, by the time since the pattern."""

from typing import TYPE_CHECKING

from observer.colours import COLOURS, HAND
from observer.report.figures.base import Columns, Drawing, Flights, legend_beside
from observer.report.tables import is_advice, reactions

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw(figure: "Figure", flights: Flights) -> None:
    curve = reactions(flights)
    after = [reaction.after for reaction in curve]
    axes = figure.add_subplot()
    by_side, by_area = ([100.0 * getattr(r, name) for r in curve] for name in ("displacement", "area"))
    axes.plot(after, by_side, marker="o", color=COLOURS[0], label="displacement")
    axes.plot(after, by_area, marker="s", color=COLOURS[1], label="area")
    axes.axhline(50.0, color=HAND, lw=0.9, ls="--", label="chance")
    axes.set(ylim=(0.0, 100.0), xlabel="time after the pattern, s", ylabel="correct reactions, %")
    axes.set_title(f"{_count(flights)} patterns")
    legend_beside(axes)


def _count(flights: Flights) -> int:
    return sum(is_advice(pattern.name) for record in flights for pattern in record.patterns)


def _columns(flights: Flights) -> Columns:
    curve = reactions(flights)
    return {name: [getattr(r, name) for r in curve] for name in ("after", "displacement", "area")}


REACTION = Drawing(
    name="reactions",
    title="Correctness of reactions",
    about="After a pattern that advises a motion (CR, CL, ER, EL): had the centroid moved to the side that was"
    " shown, and had the area grown (contracted) or shrunk (extended)? Over all flights of the report.",
    size=(6.0, 3.4),
    draw=_draw,
    columns=_columns,
    lacks=lambda flights: (
        None if _count(flights) else "no pattern of the flight sets (CR, CL, ER, EL) was played"
    ),
)
