"""One check for all recordings: what is left out, what is said, and that what is left is a recording."""

from typing import Any

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.recordings.check import GAP_S, ROOM, check, gap_ns
from shared.recordings.track import NO_STAMP, Found, Stamps

COUNT = 300
T = np.arange(COUNT) * NS_PER_S // 60 + 10**18
GOOD = Found(
    t_ns=T,
    position=np.column_stack([np.full(COUNT, 0.2), np.linspace(0.0, 1.0, COUNT), np.full(COUNT, 1.2)]),
    quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (COUNT, 1)),
    arrival_ns=T + 28_000_000,
)


def changed(name: str, rows: Any, value: Any, found: Found = GOOD) -> Found:
    """The same with other values in some rows of an array."""
    array = getattr(found, name).copy()
    array[rows] = value
    return evolve(found, **{name: array})


def without_arrival(found: Found) -> Found:
    return evolve(found, arrival_ns=None)


def test_a_good_recording_is_left_as_it_is_and_nothing_is_said() -> None:
    track, rows, arrival_ns, report = check(GOOD, "hand")
    assert np.array_equal(track.t_ns, T)
    assert np.array_equal(track.position, GOOD.position)
    assert np.array_equal(rows, np.arange(COUNT))
    assert np.array_equal(arrival_ns, T + 28_000_000)
    assert report.remarks == ()
    assert report.rate_hz == pytest.approx(60.0, rel=1e-6)
    assert (report.gaps, report.low, report.high) == (0, (0.2, 0.0, 1.2), (0.2, 1.0, 1.2))


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("position", np.nan, "not a number"),
        ("position", -np.inf, "not a number"),
        ("position", 1e300, "more than 20 m away"),
        ("quaternion", np.nan, "without an orientation"),
        ("quaternion", 0.0, "without an orientation"),
        ("quaternion", 1e300, "without an orientation"),
        ("t_ns", NO_STAMP, "without a stamp"),
        ("t_ns", T[100] + 3600 * NS_PER_S, "out of time"),
        ("t_ns", T[100] - 3600 * NS_PER_S, "out of time"),
        ("t_ns", T[99], "out of time"),
        ("t_ns", 0, "out of time"),
    ],
)
@pytest.mark.parametrize("row", [0, 100, COUNT - 1])
@pytest.mark.parametrize("has_arrivals", [True, False])
def test_one_bad_pose_is_left_out_and_no_other(
    name: str, value: float, reason: str, row: int, has_arrivals: bool
) -> None:
    found = changed(name, row, value)
    if name == "t_ns" and value == T[99]:
        found = changed(name, row, T[min(row + 1, COUNT - 2)])
    track, rows, _, report = check(found if has_arrivals else without_arrival(found), "hand")
    missing = sorted(set(range(COUNT)) - set(rows.tolist()))
    assert len(missing) == 1
    assert missing == [row] or reason == "out of time"  # of two poses with one stamp either may go
    assert report.remarks[0] == f"1 of 300 poses left out: 1 {reason} (the first: pose {missing[0] + 1})"
    assert np.all(np.diff(track.t_ns) > 0)


@pytest.mark.parametrize(
    "stamps",
    [
        np.zeros(COUNT),
        np.full(COUNT, NO_STAMP),
        T[::-1],
        np.where(np.arange(COUNT) < 150, T, T + 3600 * NS_PER_S),
    ],
    ids=["zero", "unsaid", "backwards", "clock set"],
)
def test_where_stamps_are_of_no_use_arrival_times_stand_in(stamps: Stamps) -> None:
    track, rows, _, report = check(evolve(GOOD, t_ns=stamps.astype(np.int64)), "hand")
    assert len(rows) == COUNT
    assert np.array_equal(track.t_ns, T + 28_000_000)
    assert report.remarks == ("its stamps are of no use (0, or out of order): arrival times are used",)


def test_a_recorder_that_stalls_does_not_spoil_the_stamps() -> None:
    late = changed("arrival_ns", slice(100, 160), T[160] + 28_000_000)
    track, rows, _, report = check(late, "hand")
    assert len(rows) == COUNT
    assert report.remarks == ()
    assert np.array_equal(track.t_ns, T)


def test_as_few_poses_as_possible_are_left_out() -> None:
    """A stamp far ahead used to cost everything up to there."""
    ahead = without_arrival(changed("t_ns", 60, T[60] + 4 * NS_PER_S))
    assert sorted(set(range(COUNT)) - set(check(ahead, "hand").rows.tolist())) == [60]


def test_a_format_without_orientations_needs_none() -> None:
    checked = check(evolve(GOOD, quaternion=None), "hand")
    assert checked.report.remarks == ()
    assert checked.track.quaternion.tolist() == [[0.0, 0.0, 0.0, 1.0]] * COUNT


def test_a_recording_in_which_nobody_turned_anything_keeps_its_poses() -> None:
    checked = check(changed("quaternion", slice(None), 0.0), "hand")
    assert len(checked.rows) == COUNT
    assert checked.report.remarks == ("it has no orientations: the heading stays what it is at the start",)


def test_gaps_are_told() -> None:
    keep = np.r_[0:60, 180:240, 246:300]
    found = Found(t_ns=T[keep], position=GOOD.position[keep])
    assert check(found, "hand").report.remarks == ("2 gaps, the longest of 2.0 s",)
    slow = Found(t_ns=T[::15], position=GOOD.position[::15])
    assert check(slow, "hand").report.remarks == ()
    assert gap_ns(T) == GAP_S * NS_PER_S


def test_lines_of_the_file_are_named_where_it_has_any() -> None:
    found = changed("position", 7, np.nan, evolve(GOOD, lines=np.arange(COUNT) + 2))
    assert "(the first: line 9)" in check(found, "hand").report.remarks[0]


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (evolve(GOOD, position=GOOD.position * 1000.0), "take.csv: places 1200 m away.* millimetres"),
        (changed("position", slice(None), np.nan), "300 poses are not a number"),
        (without_arrival(evolve(GOOD, t_ns=np.zeros(COUNT, dtype=np.int64))), "299 poses are out of time"),
        (
            evolve(GOOD, t_ns=T[:0], position=GOOD.position[:0], quaternion=None, arrival_ns=None),
            "fewer than two",
        ),
        (Found(t_ns=np.arange(50_000) * NS_PER_S, position=np.zeros((50_000, 3))), "more than 12 hours"),
        (Found(t_ns=np.arange(90) * 16 * NS_PER_S, position=np.zeros((90, 3))), "16.0 s from .* milliseconds"),
        (without_arrival(evolve(GOOD, t_ns=T[::-1].copy())), "come at no time: 299 .* sort them by time"),
    ],
)
def test_what_is_no_recording_is_refused(found: Found, expected: str) -> None:
    with pytest.raises(ConfigError, match=expected):
        check(found, "take.csv")


stamps = st.integers(-(2**63), 2**63 - 1) | st.sampled_from([NO_STAMP, 0, 10**18]) | st.integers(0, 10**10)
numbers = st.floats(width=64) | st.floats(-2.0, 2.0)


@given(data=st.data(), count=st.integers(0, 12))
def test_whatever_is_left_is_finite_near_and_in_order(data: st.DataObject, count: int) -> None:
    def draw(shape: Any, elements: Any, dtype: type) -> Any:
        return data.draw(arrays.arrays(dtype, shape, elements=elements))

    found = Found(
        t_ns=draw(count, stamps, np.int64),
        position=draw((count, 3), numbers, np.float64),
        quaternion=draw((count, 4), numbers, np.float64) if data.draw(st.booleans()) else None,
        arrival_ns=draw(count, stamps, np.int64) if data.draw(st.booleans()) else None,
    )
    try:
        track, rows, arrival_ns, report = check(found, "hand")
    except ConfigError:
        return
    assert len(rows) == len(track.t_ns) == len(arrival_ns) >= 2
    assert np.all(np.diff(track.t_ns) > 0)
    assert np.abs(track.position).max() <= ROOM
    assert np.abs(np.linalg.norm(track.quaternion, axis=1) - 1.0).max() < 0.11
    assert len(rows) + sum(n for n, _ in report.left_out.values()) == count
    assert all(isinstance(remark, str) for remark in report.remarks)
