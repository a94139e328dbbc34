"""Writes a report: one page, and per figure a picture for papers, one for slides, and its numbers."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import attrs
from matplotlib.figure import Figure

from observer.report.figures import FIGURES, Columns, Drawing, style
from observer.report.page import Shown, page
from observer.report.record import FlightRecord
from observer.report.tables import FleetRow, fleet_row
from shared.spreadsheet import cell, short

PAGE = "report.html"
FLEET = "fleet.csv"
_DPI = 150


def write_report(flights: Sequence[FlightRecord], folder: Path) -> Path:
    """Writes `report.html`, `fleet.csv`, and `<figure>.svg`, `.png` and `.csv` of every figure.

    Args:
        flights: One flight or several: figures show the first, the fleet table and the reactions all.
        folder: Created if missing; files of the same names are replaced.

    Returns:
        The page.

    Raises:
        OSError: It cannot be written there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    shown = [_write_figure(drawing, flights, folder) for drawing in FIGURES]
    rows = dict(zip(_names(flights), map(fleet_row, flights), strict=True))
    names = [field.name for field in attrs.fields(FleetRow)]
    fleet = {name: [getattr(row, name) for row in rows.values()] for name in names}
    _write_csv(folder / FLEET, {"flight": list(rows), **fleet})
    path = folder / PAGE
    path.write_text(page(flights, rows, shown), encoding="utf-8")
    return path


def _names(flights: Sequence[FlightRecord]) -> list[str]:
    """Returns what to call flights, each in its own way: folders of the same name may hold different ones."""
    names = list[str]()
    for record in flights:
        name, number = record.name, 1
        while name in names:
            number += 1
            name = f"{record.name} ({number})"
        names.append(name)
    return names


def _write_figure(drawing: Drawing, flights: Sequence[FlightRecord], folder: Path) -> Shown:
    absent = drawing.lacks(flights)
    if absent is not None:
        return Shown(drawing.title, drawing.about, svg=None, absent=absent)
    _write_csv(folder / f"{drawing.name}.csv", drawing.columns(flights))
    with style():
        figure = Figure(figsize=drawing.size, layout="constrained")
        drawing.draw(figure, flights)
        figure.savefig(folder / f"{drawing.name}.png", dpi=_DPI)
        figure.set_layout_engine("none")  # all is in its place now, and finding that takes as long as drawing
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
    svg = text.getvalue()
    (folder / f"{drawing.name}.svg").write_text(svg, encoding="utf-8")
    return Shown(drawing.title, drawing.about, svg)


def _write_csv(path: Path, columns: Columns) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(map(cell, columns))
        writer.writerows(map(short, row) for row in zip(*columns.values(), strict=True))
