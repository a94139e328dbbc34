"""The report as one HTML page that needs nothing else. Pure."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import NamedTuple

import attrs
import numpy as np

from observer.report.record import FlightRecord
from observer.report.tables import FleetRow
from shared.plain_text import plain

_HEADINGS = {
    "path": "path, m",
    "velocity": "velocity, m/s",
    "acceleration": "acceleration, m/s²",
    "jerk": "jerk, m/s³",
    "area_mean": "area deviation: mean, m²",
    "area_std": "std, m²",
    "area_max": "max, m²",
}
_FLEET = (
    "Of the centroid: length of its path, and mean norms of its derivatives, each low-passed at 4 Hz. Of the"
    " polygon of the drones: how far its area was from that of the undisturbed formation."
)
_LOOK = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem;
  color: #222; background: #fff; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .7rem; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; white-space: nowrap; }
figure { margin: 2.5rem 0; }
figure svg { max-width: 100%; height: auto; }
figcaption, .absent { color: #555; }
"""


class Shown(NamedTuple):
    """A figure on the page.

    Attributes:
        title: One line.
        about: What it shows.
        svg: The picture, None if these flights do not have what it shows.
        absent: Then, why.
    """

    title: str
    about: str
    svg: str | None
    absent: str | None = None


def page(flights: Sequence[FlightRecord], rows: Mapping[str, FleetRow], shown: Sequence[Shown]) -> str:
    """Returns the page.

    Args:
        flights: The flights; figures show the first.
        rows: Flight -> its row of the fleet table.
        shown: The figures, in order.
    """
    first = flights[0]
    title = f"Flight {_text(first.name)}"
    about = f"{len(first.ids)} drones, {first.t[-1]:.1f} s in formation, read from a {_text(first.source)}"
    return "\n".join(
        (
            "<!doctype html>",
            '<html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width">',
            f"<title>{title}</title><style>{_LOOK}</style></head><body>",
            f"<h1>{title}</h1><p>{about}.</p>",
            *(f'<p class="absent">{_text(remark)}</p>' for remark in remarks(flights)),
            "<h2>Fleet</h2>",
            fleet_table(rows),
            f"<p>{_FLEET}</p>",
            *map(_figure, shown),
            "</body></html>\n",
        )
    )


def remarks(flights: Sequence[FlightRecord]) -> list[str]:
    """Returns what was left out of flights, and why; each is named if there are several."""
    several = len(flights) > 1
    return [f"{one.name}: {remark}" if several else remark for one in flights for remark in one.remarks]


def fleet_table(rows: Mapping[str, FleetRow]) -> str:
    """Returns the fleet table as HTML: one row per flight, and their mean if there are several."""
    lines = {_text(name): attrs.astuple(row) for name, row in rows.items()}
    if len(lines) > 1:
        lines["<strong>mean</strong>"] = tuple(np.nanmean(list(lines.values()), axis=0).tolist())
    head = "".join(f"<th>{_HEADINGS[field.name]}</th>" for field in attrs.fields(FleetRow))
    body = "\n".join(
        f"<tr><td>{name}</td>{''.join(f'<td>{_number(value)}</td>' for value in values)}</tr>"
        for name, values in lines.items()
    )
    return f"<table><tr><th>flight</th>{head}</tr>\n{body}\n</table>"


def _text(name: str) -> str:
    """Returns a name as a page can show it."""
    return escape(plain(name))


def _number(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.4f}"


def _figure(shown: Shown) -> str:
    head = f"<h2>{escape(shown.title)}</h2>"
    if shown.svg is None:
        return f'{head}<p class="absent">Not drawn: {escape(shown.absent or "")}.</p>'
    # What stands before <svg> is for files only.
    picture = shown.svg[shown.svg.index("<svg") :]
    return f"{head}<figure>{picture}<figcaption>{escape(shown.about)}</figcaption></figure>"
