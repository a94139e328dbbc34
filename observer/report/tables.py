"""The numbers of a report: how the fleet moved, and how the operator reacted to patterns. Pure.

The fleet table is the paper's (section "Fleet performance"): centroid of the bodies in 3-D, differentiated by
the rows' times at the recorder; after each derivative a causal Butterworth filter (order 5, 4 Hz); the mean of
the norms. The deviation of the area is that of the polygon of the drones from the undisturbed formation's.

Rows in which a drone is missing do not count, and nothing is derived, filtered or measured across them.
"""

from collections.abc import Sequence

import numpy as np
from attrs import frozen
from scipy.signal import butter, lfilter, lfilter_zi

from observer.report.record import ROW_HZ, FlightRecord, runs
from shared.geometry import hull_area
from shared.recordings.track import Vec

SETTLING_ROWS = 10
"""The first differences are dropped: the recorder was still starting."""
LANDING_ROWS = 100
"""The last rows do not count for the area."""
CUTOFF_HZ, ORDER = 4.0, 5

REACTION_TIMES = (0.5, 1.1, 1.5, 2.1, 2.5, 2.9, 3.3)
"""Times after a pattern at which the reaction is judged, s."""
DECIDED = 0.1
"""An area that changed by less than this fraction of the default one decides nothing."""
_AREA, _SIDE = {"C": 1, "E": -1}, {"R": 1, "L": -1}


@frozen(kw_only=True)
class FleetRow:
    """How one fleet moved.

    Attributes:
        path: Length of the centroid's path, m.
        velocity: Mean speed of the centroid, m/s.
        acceleration: m/s^2.
        jerk: m/s^3.
        area_mean: Mean deviation of the area from the default formation's, m^2.
        area_std: Its standard deviation, m^2.
        area_max: Its largest value, m^2.
    """

    path: float
    velocity: float
    acceleration: float
    jerk: float
    area_mean: float
    area_std: float
    area_max: float


@frozen(kw_only=True)
class Reaction:
    """How often the operator reacted as advised, at one time after the patterns.

    Attributes:
        after: s.
        displacement: Fraction of patterns after which the centroid had moved to the side that was shown.
        area: Fraction after which the area had grown (contracted) or shrunk (extended); half a point where
            it had changed by less than a tenth of the default area.
    """

    after: float
    displacement: float
    area: float


def fleet_row(record: FlightRecord) -> FleetRow:
    """Returns the row of one flight; it has to be longer than `LANDING_ROWS`."""
    centroid = record.position.mean(axis=1)
    rates = _derivatives(record.recorded_t, centroid)
    speeds = [_mean(np.linalg.norm(rate, axis=1)) for rate in rates]
    deviation = np.abs(areas(record) - record.default_area)[:-LANDING_ROWS]
    return FleetRow(
        path=float(np.nansum(np.linalg.norm(np.diff(centroid, axis=0), axis=1))),
        velocity=speeds[0],
        acceleration=speeds[1],
        jerk=speeds[2],
        area_mean=float(np.nanmean(deviation)),
        area_std=float(np.nanstd(deviation)),
        area_max=float(np.nanmax(deviation)),
    )


def _mean(values: Vec) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def areas(record: FlightRecord) -> Vec:
    """Returns the area of the drones' convex hull per row, (T,), m^2; not a number where a drone is missing."""
    places = record.position[:, :, :2]
    area = np.full(len(places), np.nan)
    there = np.flatnonzero(np.isfinite(places).all(axis=(1, 2)))
    area[there] = [hull_area(map(tuple, row)) for row in places[there].tolist()]
    return area


def reactions(records: Sequence[FlightRecord]) -> tuple[Reaction, ...]:
    """Judges the reactions to the patterns that advise a motion (CR, CL, ER, EL), of all flights together.

    A pattern near the end of a flight is judged by where the flight ended. Where the formation is not known
    at the pattern or after it, the reaction is not judged.

    Returns:
        One entry per reaction time; none if no such pattern was played.
    """
    outcomes = [_outcomes(record) for record in records]
    judged = np.concatenate(outcomes) if outcomes else np.empty((0, len(REACTION_TIMES), 2))
    if not len(judged):
        return ()
    counts = np.isfinite(judged).sum(axis=0)
    means = np.where(counts, np.nansum(judged, axis=0) / np.maximum(counts, 1), np.nan)
    return tuple(
        Reaction(after=after, displacement=float(side), area=float(area))
        for after, (side, area) in zip(REACTION_TIMES, means, strict=True)
    )


def is_advice(name: str) -> bool:
    """Says whether a pattern advises a motion: of the sets `flight` and `flight-2018`, not of `paper`."""
    return len(name) == 2 and name[0] in _AREA and name[1] in _SIDE


def _outcomes(record: FlightRecord) -> Vec:
    """Returns how right the reaction was, 0..1, (patterns, times, 2): by displacement and by area."""
    advice = [pattern for pattern in record.patterns if is_advice(pattern.name)]
    if not advice:
        return np.empty((0, len(REACTION_TIMES), 2))
    begins = np.array([pattern.t for pattern in advice])
    # Right is +y: the operator looks along -x.
    side = record.position[:, :, 1].mean(axis=1)
    moved = _change(record.recorded_t, side, begins) * [[_SIDE[p.name[1]]] for p in advice]
    grown = _change(record.recorded_t, areas(record), begins) * [[_AREA[p.name[0]]] for p in advice]
    bound = DECIDED * record.default_area
    by_side = np.where(moved > 0.0, 1.0, 0.0)
    by_area = np.where(grown > bound, 1.0, np.where(grown < -bound, 0.0, 0.5))
    judged = np.stack([by_side, by_area], axis=2)
    return np.where(np.isfinite(np.stack([moved, grown], axis=2)), judged, np.nan)


def _change(t: Vec, values: Vec, begins: Vec) -> Vec:
    """Returns how much values had changed from each begin to each reaction time after it."""
    ends = begins[:, None] + np.array(REACTION_TIMES)
    change: Vec = values[_nearest(t, ends)] - values[_nearest(t, begins)][:, None]
    return change


def _nearest(t: Vec, wanted: Vec) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
    right = np.clip(np.searchsorted(t, wanted), 1, len(t) - 1)
    return np.where(wanted - t[right - 1] < t[right] - wanted, right - 1, right)


def _derivatives(t: Vec, centroid: Vec) -> list[Vec]:
    """Returns velocity, acceleration and jerk, each filtered."""
    step = np.diff(t)[SETTLING_ROWS:, None]
    step = np.where(step > 0.0, step, np.nan)
    value, rates = centroid[SETTLING_ROWS:], list[Vec]()
    for _ in range(3):
        value = _low_passed(np.diff(value, axis=0) / step[: len(value) - 1])
        rates.append(value)
    return rates


def _low_passed(values: Vec) -> Vec:
    """Filters each stretch without a gap: the first from rest, as the paper did, others from their begin."""
    numerator, denominator = butter(ORDER, CUTOFF_HZ, fs=ROW_HZ)
    steady = lfilter_zi(numerator, denominator)[:, None]
    passed = np.full_like(values, np.nan)
    for run in runs(values):
        state = steady * (values[run.start] if run.start else 0.0 * values[0])
        passed[run], _ = lfilter(numerator, denominator, values[run], axis=0, zi=state)
    return passed
