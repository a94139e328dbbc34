"""Finds the recorded flights: in `SWARMTOUCH_DATA`, else in `../shared/data` beside the repository."""

import json
import os
from pathlib import Path
from typing import Any

import pytest

from shared.recordings.flight_folder import read_patterns

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("SWARMTOUCH_DATA", ROOT.parent / "shared" / "data"))

ABSENT = f"no recorded flights in {DATA}; set SWARMTOUCH_DATA"


def flight_folders(feedback: str | None = None) -> list[Path]:
    """Returns the flight folders, sorted by name, all or those with one kind of feedback; none without data."""
    folders = sorted(path.parent for path in DATA.glob("flights/*/meta.json"))
    return [folder for folder in folders if feedback in (None, read_json(folder)["feedback"])]


def read_json(folder: Path) -> dict[str, Any]:
    """Reads what is known of a flight."""
    known: dict[str, Any] = json.loads((folder / "meta.json").read_text(encoding="utf-8"))
    return known


def a_flight(feedback: str | None = None) -> Path:
    """Returns the first flight folder, or skips the test."""
    return _first(flight_folders(feedback))


def longest_flight() -> Path:
    """Returns the flight that took longest, or skips the test."""
    return _first(sorted(flight_folders(), key=lambda folder: -read_json(folder)["duration_s"]))


def busiest_flight(seconds: float) -> Path:
    """Returns the flight in whose first seconds the operator felt most patterns, or skips the test."""

    def felt(folder: Path) -> int:
        begin_ns = read_json(folder)["control_first_ns"]
        return sum(at_ns < begin_ns + seconds * 1e9 for at_ns, _ in read_patterns(folder))

    return _first(sorted(flight_folders("tactile"), key=lambda folder: -felt(folder)))


def a_bag_and_its_flight() -> tuple[Path, Path]:
    """Returns a bag and the folder of the same flight, or skips; the package that reads it must be there."""
    pytest.importorskip("rosbags", reason="the optional package rosbags is not installed")
    pairs = [(bag, DATA / "flights" / bag.stem) for bag in sorted(DATA.glob("bags/*.bag"))]
    whole = [(bag, folder) for bag, folder in pairs if folder.is_dir()]
    if not whole:
        pytest.skip(f"no bag of a flight in {DATA}; set SWARMTOUCH_DATA")
    return whole[0]


def _first(folders: list[Path]) -> Path:
    if not folders:
        pytest.skip(ABSENT)
    return folders[0]


each_flight = pytest.mark.parametrize(
    "folder",
    [pytest.param(folder, id=folder.name) for folder in flight_folders()]
    or [pytest.param(None, id="absent", marks=pytest.mark.skip(reason=ABSENT))],
)
"""Runs a test once per flight folder."""
