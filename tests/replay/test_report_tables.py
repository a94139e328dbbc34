"""The paper's tables from the recorded flights: fleet, reactions, and the ROS bag beside its flight folder.

The reference numbers were computed from the same recordings by the recipe of the authors' published analysis.
"""

from pathlib import Path

import attrs
import numpy as np
import pytest

from observer.report.record import FlightRecord
from observer.report.recordings import read_bag_flight, read_folder
from observer.report.tables import fleet_row, reactions
from shared.errors import ConfigError
from tests.replay.flights import ABSENT, flight_folders, require_bag, require_flight

SUBJECTS = ("S1", "S2", "S3")
FLEET = {
    ("tactile", (1,)): (5.6579, 0.0924, 0.1845, 1.1258, 0.0102, 0.0097, 0.0402),
    ("tactile", (1, 2)): (5.6314, 0.1123, 0.2183, 1.3230, 0.0105, 0.0096, 0.0423),
    ("visual", (1,)): (3.8360, 0.2671, 0.3672, 2.2000, 0.0072, 0.0070, 0.0284),
    ("visual", (1, 2)): (3.8139, 0.2696, 0.3632, 2.1887, 0.0065, 0.0065, 0.0289),
}
"""Mean over the subjects: path, velocity, acceleration, jerk, and mean, std, max of the area's deviation."""
ROUNDED = 5e-5
"""The numbers above have four digits."""

PAPER_CORRECT = (75.0, 80.0)
"""The paper: so many reactions, %, were right by displacement 2 to 3 s after a pattern."""


@pytest.fixture(scope="module")
def flights() -> dict[str, FlightRecord]:
    folders = flight_folders()
    if not folders:
        pytest.skip(ABSENT)
    return {folder.name: read_folder(folder) for folder in folders}


@pytest.mark.parametrize(("feedback", "trials"), FLEET)
def test_the_fleet_table(flights: dict[str, FlightRecord], feedback: str, trials: tuple[int, ...]) -> None:
    names = [f"{subject}_{feedback}_{trial}" for subject in SUBJECTS for trial in trials]
    rows = np.array([attrs.astuple(fleet_row(flights[name])) for name in names])
    mean = rows.mean(axis=0)
    print(f"{feedback}, trials {trials}: {np.round(mean, 4)}")
    assert mean == pytest.approx(FLEET[feedback, trials], rel=0.01, abs=ROUNDED)


def test_the_reactions_are_as_right_as_the_paper_says(flights: dict[str, FlightRecord]) -> None:
    curve = reactions(list(flights.values()))
    for reaction in curve:
        print(f"{reaction.after} s: displacement {reaction.displacement:.1%}, area {reaction.area:.1%}")
    low, high = PAPER_CORRECT
    judged = [100.0 * reaction.displacement for reaction in curve if 2.0 <= reaction.after <= 3.0]
    assert len(judged) == 3
    assert all(low - 2.0 <= percent <= high + 2.0 for percent in judged)
    # Longer after a pattern, more of the contracted and extended formations have recovered.
    area = [reaction.area for reaction in curve]
    assert area == sorted(area)
    assert area[0] < 0.5 < area[-1]


def test_a_bag_gives_the_numbers_of_its_flight_folder() -> None:
    bag = read_bag_flight(require_bag("S3_visual_1.bag"))
    folder = read_folder(require_flight("S3_visual_1"))
    assert attrs.astuple(fleet_row(bag)) == pytest.approx(attrs.astuple(fleet_row(folder)), rel=1e-4)
    assert np.abs(bag.position - folder.position).max() < 1e-6
    assert np.abs(bag.setpoint - folder.setpoint).max() < 1e-6
    assert (bag.hand_label, folder.hand_label) == ("hand", "mapped hand")
    assert {o.name for o in bag.obstacles} == {o.name for o in folder.obstacles}
    places = [{o.name: (o.x, o.y) for o in flight.obstacles} for flight in (bag, folder)]
    assert all(places[0][name] == pytest.approx(places[1][name], abs=1e-6) for name in places[0])


def test_goals_and_set_points_differ_only_where_columns_are_near(flights: dict[str, FlightRecord]) -> None:
    """The mapped hand and the rest formation give the goals: most of the time drones were told just those."""
    for name, record in flights.items():
        apart = np.linalg.norm(record.goal - record.setpoint, axis=2)
        assert np.median(apart) < 0.1, name
        assert record.mapped[:, :2].min() >= -1.7 - 1e-9


def test_a_folder_without_patterns_has_none(flights: dict[str, FlightRecord]) -> None:
    felt = {name: len(record.patterns) for name, record in flights.items()}
    assert all(bool(count) == ("tactile" in name) for name, count in felt.items())
    assert felt["S1_tactile_1"] == 21


def test_a_broken_bag_is_named(tmp_path: Path) -> None:
    bag = require_bag("S3_visual_1.bag")
    broken = tmp_path / "broken.bag"
    broken.write_bytes(bag.read_bytes()[:1000])
    with pytest.raises(ConfigError, match=r"broken\.bag"):
        read_bag_flight(broken)
