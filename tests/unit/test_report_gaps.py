"""Drones are aligned by stamp, and where one was not seen the report has a gap: in every number and figure."""

import csv
from pathlib import Path

import attrs
import numpy as np
import pytest
from msgspec.structs import replace

from observer.report.figures import FIGURES
from observer.report.record import FlightRecord
from observer.report.source import open_record
from observer.report.tables import areas, fleet_row, reactions
from observer.report.write import write_report
from shared.messages import DroneState
from tests.flight_folders import Seen, body_place, write_flight
from tests.synthetic_swarm import T0, TICK, fly
from tests.unit.test_report import write_trace

ADVICE = ((2.0, "contracted_right"), (6.0, "extended_left"))


def read(folder: Path, is_seen: Seen = lambda *_: True) -> FlightRecord:
    return open_record(write_flight(folder, is_seen=is_seen, patterns=ADVICE))


def hide(name: str, begin: float, end: float) -> Seen:
    """Nobody sees a body for a while; all of them if it is named `*`."""
    return lambda body, t: not (body in (name, name.replace("*", body)) and begin < t < end)


@pytest.mark.parametrize("name", ["cf1", "cf2", "cf3", "*"])
@pytest.mark.parametrize("span", [(0.0, 0.5), (4.0, 5.0), (9.5, 10.1)], ids=["begin", "middle", "end"])
def test_a_second_out_of_sight_shifts_nobody(tmp_path: Path, name: str, span: tuple[float, float]) -> None:
    whole, gappy = read(tmp_path / "whole"), read(tmp_path / "gappy", hide(name, *span))
    every, some = attrs.asdict(fleet_row(whole)), attrs.asdict(fleet_row(gappy))
    assert some["area_max"] == pytest.approx(every["area_max"], rel=0.02)
    assert some["area_mean"] == pytest.approx(every["area_mean"], rel=0.2)
    if span[0] > 0.0:  # how fast it begins makes a difference: the filter starts from rest
        for derived in ("velocity", "acceleration"):
            assert some[derived] == pytest.approx(every[derived], rel=0.15)
    assert some["path"] <= every["path"] * 1.001
    assert np.array_equal(np.diff(gappy.t) < 0.02, np.full(len(gappy.t) - 1, True))


@pytest.mark.parametrize("name", ["cf1", "cf3"])
def test_who_is_not_seen_is_nowhere_and_everybody_else_where_they_are(tmp_path: Path, name: str) -> None:
    record = read(tmp_path, hide(name, 4.0, 5.0))
    column = int(name[-1]) - 1
    unseen = (record.t > 4.0 + 1e-6) & (record.t < 5.0 - 1e-6)
    assert np.array_equal(np.isnan(record.position[:, column, 0]), unseen)
    for other in {0, 1, 2} - {column}:
        expected = [body_place(f"cf{other + 1}", t) for t in record.t]
        assert np.abs(record.position[:, other] - expected).max() < 1e-6
    assert np.array_equal(np.isnan(areas(record)), unseen)


def test_a_few_lost_frames_are_bridged(tmp_path: Path) -> None:
    record = read(tmp_path, lambda body, t: body != "cf2" or round(t * 60) % 20 < 16)
    assert not np.isnan(record.position).any()
    assert np.abs(record.position[:, 1] - [body_place("cf2", t) for t in record.t]).max() < 2e-3


def test_a_hand_out_of_sight_has_no_velocity(tmp_path: Path) -> None:
    record = read(tmp_path, hide("glove", 4.0, 5.0))
    unseen = (record.t > 4.0 + 1e-6) & (record.t < 5.0 - 1e-6)
    assert np.array_equal(np.isnan(record.hand[:, 0]), unseen)
    assert np.array_equal(np.isnan(record.hand_velocity[:, 0]), unseen)
    assert record.remarks == ("hand: a gap of 1.0 s",)


def test_a_reaction_that_nobody_saw_is_not_judged(tmp_path: Path) -> None:
    whole, gappy = read(tmp_path / "whole"), read(tmp_path / "gappy", hide("cf2", 1.9, 3.4))
    second = attrs.evolve(whole, patterns=whole.patterns[1:])
    assert reactions([gappy]) == reactions([second])
    nothing = attrs.evolve(gappy, patterns=gappy.patterns[:1])
    assert all(np.isnan(r.displacement) and np.isnan(r.area) for r in reactions([nothing]))


@pytest.mark.parametrize("name", ["cf1", "glove", "*"])
def test_every_figure_is_drawn_and_its_table_is_empty_in_the_gap(tmp_path: Path, name: str) -> None:
    record = read(tmp_path / "flight", hide(name, 4.0, 5.0))
    page = write_report([record], tmp_path / "report")
    text = page.read_text(encoding="utf-8")
    assert text.count("<svg") == len(FIGURES)
    assert "a gap of 1.0 s" in text
    assert "nan" not in (tmp_path / "report" / "fleet.csv").read_text(encoding="utf-8")
    with (tmp_path / "report" / "tracking.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    gap = [row for row in rows if 4.01 < float(row["t"]) < 4.99]
    column = "hand_x" if name == "glove" else "actual_x"
    assert len(gap) > 50
    assert {row[column] for row in gap} == {""}
    assert "" not in {row[column] for row in rows if float(row["t"]) < 3.99}


def test_who_was_silent_in_a_trace_has_a_gap_there(tmp_path: Path) -> None:
    begin, end = T0 + 100 * TICK, T0 + 160 * TICK
    messages = [
        m for m in fly(300) if not (isinstance(m, DroneState) and m.id == 2 and begin < m.step_ns < end)
    ]
    record = open_record(write_trace(tmp_path / "run", messages))
    silent = np.isnan(record.position[:, 1, 0])
    assert 50 < np.count_nonzero(silent) < 65
    assert not np.isnan(np.delete(record.position, 1, axis=1)).any()
    assert "drone 2: a gap of 1.0 s" in record.remarks
    write_report([record], tmp_path / "report")


@pytest.mark.parametrize("stamp", [0, 2**63 - 1, 2**63, 2**64 - 1, T0 + 10**15])
def test_one_stamp_that_cannot_be_costs_one_state(tmp_path: Path, stamp: int) -> None:
    messages = fly(300)
    at = next(k for k, m in enumerate(messages) if isinstance(m, DroneState) and (m.id, m.seq) == (3, 120))
    messages[at] = replace(messages[at], step_ns=stamp)
    record = open_record(write_trace(tmp_path, messages))
    assert not np.isnan(record.position).any()
    assert record.t[-1] < 5.0
    assert any(remark.startswith("drone 3: 1 of ") for remark in record.remarks)
