"""Tables of traces that would fill a disk, and cells that would be formulas."""

import csv
import resource
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.cli import main
from observer.trace.read import open_trace
from observer.trace.tables import export_csv, most_columns
from observer.trace.write import TraceWriter
from shared.clock import NS_PER_S
from shared.codec import encode
from shared.messages import Heard, Message, PatternEvent, ProcessStatus
from shared.spreadsheet import cell, short
from shared.topics import DRONE_STATE, HAND, PATTERN, STATUS
from shared.transport import Arrival
from tests.traces import SCENARIO, START_NS, hand, state

Sent = list[tuple[str, Message, int]]


def tables_of(folder: Path, sent: Sent) -> dict[str, list[dict[str, str]]]:
    """Records messages at times and exports them; returns the rows by file name."""
    writer = TraceWriter(folder, SCENARIO)
    for key, message, log_ns in sent:
        writer.add(key, Arrival(encode(message), log_ns))
    writer.close(0)
    exported = export_csv(open_trace(folder), folder / "tables")
    return {path.name: read(path) for path in exported.files}


def read(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_silence_of_years_is_no_row(tmp_path: Path) -> None:
    times = (START_NS, START_NS + NS_PER_S, START_NS + 10**10 * NS_PER_S)
    sent: Sent = [(HAND.key(), hand(seq), log_ns) for seq, log_ns in enumerate(times)]
    rows = tables_of(tmp_path, sent)["aligned.csv"]
    assert len(rows) < 100
    seconds = [float(row["time_s"]) for row in rows]
    assert all(t * 60 == pytest.approx(round(t * 60), abs=1e-3) for t in seconds)
    assert {row["human_hand_mode"] for row in rows if float(row["time_s"]) % 1.0 < 0.25} == {"FLY"}


def test_made_up_names_are_no_columns(tmp_path: Path) -> None:
    made_up = [{f"{seq}{n}": Heard(1, 2, 3) for n in range(90)} for seq in range(60)]
    sent: Sent = [
        (DRONE_STATE.key(id=1), state(1, seq, heard=heard), START_NS) for seq, heard in enumerate(made_up)
    ]
    rows = tables_of(tmp_path, sent)["drone-1-state.csv"]
    assert len(rows) == 60
    assert len(rows[0]) == most_columns(SCENARIO) < 400
    assert {row["mode"] for row in rows} == {"FOLLOW"}
    assert export_csv(open_trace(tmp_path), tmp_path / "again").left_out > 100


def test_foreign_drones_have_tables_and_no_columns_beside_the_others(tmp_path: Path) -> None:
    sent: Sent = [(DRONE_STATE.key(id=i), state(i, 1), START_NS + i) for i in (1, 4, 5, 60_000)]
    tables = tables_of(tmp_path, sent)
    assert "drone-60000-state.csv" in tables
    own = {name.split("_")[1] for name in tables["aligned.csv"][0] if name.startswith("drone_")}
    assert own == {"1", "4"}


def test_there_may_be_more_keys_than_files_that_a_process_may_open(tmp_path: Path) -> None:
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    keys = [("drone", i) for i in range(1, 200)]
    sent: Sent = [(STATUS.key(role=role, id=i), ProcessStatus(**health(role, i)), START_NS) for role, i in keys]
    resource.setrlimit(resource.RLIMIT_NOFILE, (100, limits[1]))
    try:
        tables = tables_of(tmp_path, sent)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    assert len(tables) == len(keys) + 1
    assert all(len(rows) == 1 for name, rows in tables.items() if name.startswith("status"))


def health(role: str, number: int, **fields: Any) -> dict[str, Any]:
    envelope = {"epoch": 1, "seq": 1, "stamp_ns": START_NS}
    return {**envelope, "role": role, "id": number, "pid": 5, "host": "here", "state": "running", **fields}


NASTY = (
    "=1+1",
    "+1+1",
    "-1+1",
    "@SUM(A1)",
    " =1",
    "\t=1",
    "=cmd|' /C calc'!A0",
    "＝1",
    "a\0b",
    "x\x1b[2J",
    "$\\frac{$",
)


@pytest.mark.parametrize("text", NASTY)
def test_no_text_becomes_a_formula(tmp_path: Path, text: str) -> None:
    event = PatternEvent(epoch=1, seq=1, stamp_ns=START_NS, pattern=text, outcome="started", state_seq=3)
    status = ProcessStatus(**health("drone", 1, host=text, rejected={text: 3}))
    sent: Sent = [(PATTERN.key(), event, START_NS), (STATUS.key(role="drone", id=1), status, START_NS)]
    tables_of(tmp_path, sent)
    assert (
        main(
            ["trace", "export", str(tmp_path), "--csv", str(tmp_path / "t"), "--foxglove", str(tmp_path / "f")]
        )
        == 0
    )
    for path in (tmp_path / "t").iterdir():
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.reader(file):
                assert all(is_harmless(text) for text in row), row


def is_harmless(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text.isprintable() and not text.lstrip().startswith(("=", "+", "-", "@", "＝"))
    return True


@given(number=st.floats(allow_nan=False, allow_infinity=False) | st.integers())
def test_numbers_stay_numbers(number: float) -> None:
    assert cell(number) == number
    assert float(str(short(float(number)))) == pytest.approx(float(number), rel=1e-8)


@given(text=st.text())
def test_whatever_a_text_is_its_cell_is_harmless(text: str) -> None:
    assert is_harmless(str(cell(text)))


def test_what_is_no_number_is_empty() -> None:
    assert [cell(value) for value in (float("nan"), float("inf"), -float("inf"))] == ["", "", ""]
    assert short(float("nan")) == ""
    assert cell("-0.5") == "-0.5"
