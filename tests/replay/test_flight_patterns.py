"""The patterns of the recorded tactile flights, reproduced by rule and set `flight-2018`.

A row without a name in the recorded topic is a tick of the original loop with the gate open. If the rule finds
a pattern there, its name follows as an event once it has been sent to the glove, about 0.14 s later. Then, and
also after a contracted or extended tick without a side, the gate is closed: no rows for 0.8 or 1.4 s.

With the gate from the recording, the rule is asked at every open tick; the names of events are only compared.
Free running, the scheduler keeps the gate itself, and its events are matched to the recorded ones.
"""

import csv
import gzip
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from glove_bridge.formation_state import Geometry, Memory, Reading, Scene, default_geometry
from glove_bridge.meaning import advice_pattern
from glove_bridge.patterns import load_patterns
from glove_bridge.rules import RULES
from glove_bridge.scheduler import Request, Schedule, decide, ended, started
from shared.formation import build_formation
from shared.recordings.flight_folder import read_meta
from tests.replay.flights import ABSENT, flight_folders
from tests.replay.test_setpoint_law import flown_scenario, load, match_frames

Ints = npt.NDArray[np.int64]

MS = 1_000_000
PATTERNS = load_patterns("flight-2018")
NAMES = {"contracted_right": "CR", "contracted_left": "CL", "extended_right": "ER", "extended_left": "EL"}
SENDING_MS = 140
"""From a tick to its event: sending to the glove took about so long (110 to 200)."""
TOLERANCE_MS = 100
FREE_TOLERANCE_MS = 500
CLOSED_MS = 300
"""Rows farther apart than this have a closed gate between them; the loop itself ran at 16-24 Hz."""
SILENT = "silent"
TOPIC = "pattern_topic.csv.gz"

each_tactile_flight = pytest.mark.parametrize(
    "folder",
    [pytest.param(folder, id=folder.name) for folder in flight_folders() if (folder / TOPIC).is_file()]
    or [pytest.param(None, id="absent", marks=pytest.mark.skip(reason=ABSENT))],
)


class Recorded(NamedTuple):
    """What the rule gets, one entry per tick of the original loop."""

    tick_ns: Ints
    scenes: list[Scene]
    geometry: Geometry


class Event(NamedTuple):
    at_ns: int
    name: str


class OpenTick(NamedTuple):
    """A tick with the gate open, and what followed: an event, a silent gate, or nothing."""

    at_ns: int
    follows: str
    event_ns: int


def read_flight(folder: Path) -> Recorded:
    flight, formation = load(folder), build_formation(flown_scenario(read_meta(folder)))
    ticks, frames = match_frames(flight)
    still = np.zeros((3, 2))
    scenes = [
        Scene(position=setpoint, velocity=still, goal=wanted, setpoint=setpoint, yaw=0.0)
        for setpoint, wanted in zip(flight.recorded[ticks], flight.wanted[frames], strict=True)
    ]
    return Recorded(flight.tick_ns[ticks], scenes, default_geometry(formation, formation.ids))


def read_topic(folder: Path) -> list[Event]:
    with gzip.open(folder / TOPIC, "rt", newline="") as file:
        return [Event(int(row["t_bag_ns"]), NAMES.get(row["name"], "")) for row in csv.DictReader(file)]


def open_ticks(rows: list[Event]) -> Iterator[OpenTick]:
    for row, following in itertools.pairwise(rows):
        if row.name:
            continue
        silent = not following.name and following.at_ns - row.at_ns > CLOSED_MS * MS
        yield OpenTick(row.at_ns, following.name or (SILENT if silent else ""), following.at_ns)


def read_all(flight: Recorded) -> list[Reading]:
    rule = RULES[PATTERNS.rule]
    return [rule(flight.geometry, scene, Memory(), PATTERNS.thresholds)[0] for scene in flight.scenes]


@each_tactile_flight
def test_every_event_and_every_silent_gate_follow_from_the_rule(folder: Path) -> None:
    flight, expected, found, lags = read_flight(folder), [], [], []
    readings, has_closed = read_all(flight), False
    for tick in open_ticks(read_topic(folder)):
        row = int(np.searchsorted(flight.tick_ns, tick.at_ns)) - 1
        if row < 0:
            continue
        name = advice_pattern(readings[row])
        if name is None and readings[row].extent and has_closed:
            name = SILENT  # before the first event there is no last gate to repeat
        has_closed |= bool(tick.follows)
        expected.append(tick.follows)
        found.append(name or "")
        if tick.follows not in ("", SILENT):
            lags.append((tick.event_ns - tick.at_ns) / MS - SENDING_MS)
    events = [name for name in expected if name not in ("", SILENT)]
    print(
        f"{folder.name}: {len(events)} events, {expected.count(SILENT)} silent gates, {len(found)} open ticks;"
        f" largest error in time {np.abs(lags).max(initial=0.0):.0f} ms"
    )
    assert found == expected
    assert np.abs(lags).max(initial=0.0) < TOLERANCE_MS
    assert len(events) == len([row for row in read_topic(folder) if row.name and row.at_ns > flight.tick_ns[0]])


def run_freely(flight: Recorded) -> list[Event]:
    """Lets the scheduler keep the gate; the glove takes the usual time to be sent a pattern."""
    schedule, events, ends_ns = Schedule(), list[Event](), 0
    for tick_ns, reading in zip(flight.tick_ns.tolist(), read_all(flight), strict=True):
        if schedule.playing and tick_ns >= ends_ns:
            schedule = ended(schedule, felt=True)
        name = advice_pattern(reading)
        wish = Request(pattern=PATTERNS.patterns[name], state_seq=0) if name else None
        schedule, decision = decide(schedule, wish, [], tick_ns, silent=reading.extent != 0)
        if decision.play:
            start_ns = tick_ns + SENDING_MS * MS
            ends_ns = start_ns + decision.play.pattern.length_ms * MS
            schedule = started(schedule, start_ns)
            events.append(Event(start_ns, decision.play.pattern.name))
    return events


def matches(found: list[Event], recorded: list[Event]) -> int:
    """How many events have a partner of the same name within the tolerance, each used once."""
    left = list(recorded)
    for event in found:
        near = [o for o in left if o.name == event.name and abs(o.at_ns - event.at_ns) < FREE_TOLERANCE_MS * MS]
        if near:
            left.remove(min(near, key=lambda other: abs(other.at_ns - event.at_ns)))
    return len(recorded) - len(left)


@each_tactile_flight
def test_running_freely_most_events_come_at_their_time(folder: Path) -> None:
    recorded = [row for row in read_topic(folder) if row.name]
    found = run_freely(read_flight(folder))
    hits = matches(found, recorded)
    precision, recall = hits / len(found), hits / len(recorded)
    print(
        f"{folder.name}: {hits} of {len(recorded)} events found, {len(found) - hits} others;"
        f" precision {precision:.2f}, recall {recall:.2f} (within {FREE_TOLERANCE_MS} ms)"
    )
    assert precision >= 0.7
    assert recall >= 0.7
