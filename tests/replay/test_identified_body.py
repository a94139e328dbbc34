"""The identified body, driven by the recorded set-points, against the real drones.

Convention: zero-order hold of the set-points on their source stamps, start at the first set-point with the
recorded pose, the velocity of the first 0.1 s and an empty integral; nothing is skipped. Per run: RMS of the
horizontal distance over all samples of its three drones. Pooled over trial 2, later than 5 s after the start
(the real integral at the start is unknown), it is 18.8 mm where DESIGN section 7 has 18.9.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from agents.vehicles.bodies.fleet import BODIES
from agents.vehicles.bodies.pid import hovering
from agents.vehicles.bodies.state import FLY
from shared.recordings.flight_folder import read_setpoints, read_track
from tests.replay.flights import ABSENT, flight_folders, read_json
from tests.values import vector

Vec = npt.NDArray[np.float64]

SUBSTEP = 0.004
FITTED_TRIAL = 1
"""The body was fitted on the first trials."""
START_SPAN = 6  # frames of 60 Hz


class Flight(NamedTuple):
    """One recorded drone: times from its first set-point (s), positions (n, 3), set-points."""

    run: str
    t: Vec
    position: Vec
    setpoint_t: Vec
    setpoint: Vec


def read_flight(folder: Path, drone: int) -> Flight:
    track, setpoints = (
        read_track(folder / f"cf{drone}.csv.gz"),
        read_setpoints(folder / f"cf{drone}_sp.csv.gz"),
    )
    first = int(np.searchsorted(track.t_ns, setpoints.t_ns[0]))
    last = int(np.searchsorted(track.t_ns, setpoints.t_ns[-1]))
    t0 = track.t_ns[first]
    return Flight(
        folder.name,
        (track.t_ns[first:last] - t0) / 1e9,
        track.position[first:last],
        (setpoints.t_ns - t0) / 1e9,
        setpoints.position,
    )


def fly(flight: Flight) -> Vec:
    """Flies the body; returns (n, 2) horizontal positions at the flight's own times."""
    start = vector(flight.position[0])
    velocity = (flight.position[START_SPAN] - flight.position[0]) / flight.t[START_SPAN]
    body, flown = hovering(start).moved(start, vector(velocity)), []
    times = np.arange(0.0, flight.t[-1] + SUBSTEP, SUBSTEP)
    for held in _hold(flight, times).tolist():
        flown.append(body.position)
        body = BODIES["identified"].fly(body, FLY, vector(held), SUBSTEP, 1)
    return np.column_stack([np.interp(flight.t, times, np.array(flown)[:, axis]) for axis in (0, 1)])


def _hold(flight: Flight, times: Vec) -> Vec:
    rows = np.searchsorted(flight.setpoint_t, times, side="right") - 1
    return flight.setpoint[np.clip(rows, 0, None)]


def rms_by_run(runs: list[str], errors: list[Vec]) -> dict[str, float]:
    pooled = {run: np.concatenate([e for e, r in zip(errors, runs, strict=True) if r == run]) for run in runs}
    return {run: float(np.sqrt((e**2).sum(axis=1).mean())) for run, e in pooled.items()}


def test_identified_body_follows_the_real_drones(record_property: Callable[[str, object], None]) -> None:
    folders = flight_folders()
    flights = [read_flight(folder, drone) for folder in folders for drone in (1, 2, 3)]
    if not flights:
        pytest.skip(ABSENT)
    errors = [fly(f) - f.position[:, :2] for f in flights]
    lags = [_hold(f, f.t)[:, :2] - f.position[:, :2] for f in flights]
    runs = [f.run for f in flights]
    by_run, lag_by_run = rms_by_run(runs, errors), rms_by_run(runs, lags)
    for run, value in by_run.items():
        record_property(f"{run}_rms_mm", round(1e3 * value, 2))
        print(f"{run}: {1e3 * value:.1f} mm, set-points themselves {1e3 * lag_by_run[run]:.1f} mm")
    unseen = [by_run[folder.name] for folder in folders if read_json(folder)["trial"] > FITTED_TRIAL]
    assert not unseen or np.mean(unseen) <= 0.022, by_run
    assert all(by_run[run] < 0.5 * lag_by_run[run] for run in by_run), (by_run, lag_by_run)
