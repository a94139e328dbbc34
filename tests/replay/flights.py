"""Finds the recorded flights: in `SWARMTOUCH_DATA`, else in `../shared/data` beside the repository."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("SWARMTOUCH_DATA", ROOT.parent / "shared" / "data"))

ABSENT = f"no recorded flights in {DATA}; set SWARMTOUCH_DATA"


def flight_folders() -> list[Path]:
    """Returns every flight folder, sorted by name; none where the data is absent."""
    return sorted(path.parent for path in DATA.glob("flights/*/meta.json"))


def require_flight(name: str) -> Path:
    """Returns one flight folder, or skips the test."""
    folder = DATA / "flights" / name
    if not folder.is_dir():
        pytest.skip(ABSENT)
    return folder


def require_bag(name: str) -> Path:
    """Returns one recorded bag, or skips the test; the package that reads it must be there too."""
    pytest.importorskip("rosbags", reason="the optional package rosbags is not installed")
    path = DATA / "bags" / name
    if not path.is_file():
        pytest.skip(f"no bag {path}; set SWARMTOUCH_DATA")
    return path


each_flight = pytest.mark.parametrize(
    "folder",
    [pytest.param(folder, id=folder.name) for folder in flight_folders()]
    or [pytest.param(None, id="absent", marks=pytest.mark.skip(reason=ABSENT))],
)
"""Runs a test once per flight folder."""
