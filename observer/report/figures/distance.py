"""Distance between the first and the last drone: how far the formation is stretched."""

import math
from typing import TYPE_CHECKING

import numpy as np

from observer.colours import COLOURS, HAND
from observer.report.figures.base import Drawing, Flights, legend_beside
from observer.report.record import FlightRecord
from shared.recordings.track import Vec

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TOLERANCE = 0.1
"""A neighbour is out of place beyond this fraction of the default distance (paper section 5.2)."""


def _draw(figure: "Figure", flights: Flights) -> None:
    record = flights[0]
    axes = figure.add_subplot()
    first, last, default = record.ids[0], record.ids[-1], _default(record)
    axes.plot(record.t, _distance(record), color=COLOURS[0], lw=1.1, label=f"drones {first} to {last}")
    axes.axhline(default, color=HAND, lw=0.9, ls="--", label="default")
    band = (default * (1.0 - TOLERANCE), default * (1.0 + TOLERANCE))
    axes.axhspan(*band, color=COLOURS[4], alpha=0.25, lw=0, label=f"within {TOLERANCE:.0%}")
    axes.set(xlabel="time, s", ylabel=f"distance {first}-{last}, m")
    legend_beside(axes)


def _distance(record: FlightRecord) -> Vec:
    between: Vec = np.linalg.norm(record.position[:, -1] - record.position[:, 0], axis=1)
    return between


def _default(record: FlightRecord) -> float:
    return math.dist(record.formation.rest[-1], record.formation.rest[0])


DISTANCE = Drawing(
    name="distance",
    title="Distance between the first and the last drone",
    about="How far the formation stretches and shrinks; dashed where it rests, shaded up to a tenth off.",
    size=(8.0, 3.0),
    draw=_draw,
    columns=lambda flights: {"t": flights[0].t, "distance": _distance(flights[0])},
    lacks=lambda flights: "one drone has no distance to another" if len(flights[0].ids) < 2 else None,
)
