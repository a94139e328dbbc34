"""Calibrations: from a pattern's frequency to a motor's duty, within what the motor may get."""

from itertools import pairwise
from pathlib import Path

import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

from glove_bridge.calibration import LONGEST_KICK_MS, Calibration, Motor, device_frames, wire_duty
from glove_bridge.calibration_file import SHIPPED, load_calibration, save_calibration
from glove_bridge.patterns import load_patterns, shipped_sets
from glove_bridge.patterns.pattern import Frame, Pattern
from glove_bridge.patterns.schema import FINGERS, HIGHEST_HZ, LOWEST_HZ, MOST_FRAMES
from glove_bridge.protocol import MAX_FRAMES, Play, PlayFrame
from shared.errors import ConfigError

FREQUENCY = st.floats(LOWEST_HZ, HIGHEST_HZ)


@st.composite
def motors(draw: st.DrawFn) -> Motor:
    size = draw(st.integers(2, 6))
    duties = sorted(draw(st.sets(st.integers(1, 100), min_size=size, max_size=size)))
    hz = sorted(draw(st.sets(st.integers(20, 400), min_size=size, max_size=size)))
    return Motor(
        start_duty=draw(st.floats(0.0, 0.2)),
        duty_hz=tuple((duty / 100, float(f)) for duty, f in zip(duties, hz, strict=True)),
        kick_ms=draw(st.integers(0, LONGEST_KICK_MS)),
        max_v=draw(st.floats(1.0, 5.0)),
    )


CALIBRATIONS = st.builds(
    Calibration,
    about=st.text(max_size=20),
    supply_v=st.just(5.0),
    motors=st.fixed_dictionaries({str(finger): motors() for finger in FINGERS}),
)
PATTERNS = st.builds(
    Pattern,
    name=st.just("X"),
    frames=st.lists(
        st.builds(Frame, st.integers(20, 300), st.dictionaries(st.sampled_from(FINGERS), FREQUENCY)),
        min_size=1,
        max_size=MOST_FRAMES,
    ).map(tuple),
    gate_ms=st.just(5_000),
)


@given(CALIBRATIONS, st.sampled_from(FINGERS), FREQUENCY, FREQUENCY)
def test_a_duty_rises_with_the_frequency_and_keeps_its_limits(
    calibration: Calibration, finger: int, one: float, other: float
) -> None:
    low, high = sorted((one, other))
    motor, limit = calibration.motors[str(finger)], calibration.limit(finger)
    assert motor.start_duty <= calibration.duty(finger, low) <= calibration.duty(finger, high) <= limit
    assert limit * calibration.supply_v <= motor.max_v * (1 + 1e-9)


@given(CALIBRATIONS, st.sampled_from(FINGERS), FREQUENCY)
def test_where_nothing_limits_the_frequency_comes_back(
    calibration: Calibration, finger: int, hz: float
) -> None:
    motor, duty = calibration.motors[str(finger)], calibration.duty(finger, hz)
    inside = motor.duty_hz[0][1] <= hz <= motor.duty_hz[-1][1]
    if inside and motor.start_duty < duty < calibration.limit(finger):
        assert calibration.hz(finger, duty) == pytest.approx(hz)


@given(CALIBRATIONS, PATTERNS)
def test_a_pattern_keeps_its_length_its_fingers_and_fits(calibration: Calibration, pattern: Pattern) -> None:
    frames = device_frames(pattern, calibration)
    assert len(frames) <= 2 * len(pattern.frames) <= MAX_FRAMES
    assert Play(0, frames).length_ms == pattern.length_ms
    for frame, duties in by_millisecond(pattern, frames):
        assert {finger for finger in FINGERS if duties[finger - 1]} <= set(frame.hz)
        for finger in frame.hz:
            wanted = wire_duty(calibration.duty(finger, frame.hz[finger]))
            assert duties[finger - 1] in (wanted, wire_duty(calibration.limit(finger)))


def by_millisecond(pattern: Pattern, frames: tuple[PlayFrame, ...]) -> list[tuple[Frame, tuple[int, ...]]]:
    wanted = [frame for frame in pattern.frames for _ in range(frame.ms)]
    got = [frame.duties for frame in frames for _ in range(frame.ms)]
    return list(zip(wanted, got, strict=True))


@given(CALIBRATIONS, PATTERNS)
def test_only_a_motor_that_rested_is_kicked(calibration: Calibration, pattern: Pattern) -> None:
    plain = evolve(
        calibration, motors={finger: evolve(m, kick_ms=0) for finger, m in calibration.motors.items()}
    )
    assert len(device_frames(pattern, plain)) == len(pattern.frames)
    ends = [sum(frame.ms for frame in pattern.frames[:k]) for k in range(len(pattern.frames))]
    got = by_millisecond(pattern, device_frames(pattern, calibration))
    expected = by_millisecond(pattern, device_frames(pattern, plain))
    for begin, (before, frame) in zip(ends[1:], pairwise(pattern.frames), strict=False):
        for finger in set(before.hz) & set(frame.hz):
            assert got[begin][1][finger - 1] == expected[begin][1][finger - 1]


def test_the_shipped_calibration_gives_these_duties() -> None:
    calibration = load_calibration()
    assert [calibration.duty(3, hz) for hz in (150.0, 200.0, 250.0)] == pytest.approx([0.45, 0.6, 0.75])
    frames = device_frames(load_patterns("paper").patterns["EI"], calibration)
    assert frames == (
        PlayFrame(40, (0, 0, 193, 0, 0)),
        PlayFrame(160, (0, 0, 114, 0, 0)),
        PlayFrame(40, (0, 193, 0, 193, 0)),
        PlayFrame(160, (0, 153, 0, 153, 0)),
        PlayFrame(40, (193, 0, 0, 0, 193)),
        PlayFrame(260, (191, 0, 0, 0, 191)),
    )


def test_every_shipped_pattern_can_be_played() -> None:
    calibration = load_calibration()
    for name in shipped_sets():
        for pattern in load_patterns(name).patterns.values():
            assert Play(0, device_frames(pattern, calibration)).length_ms == pattern.length_ms


@given(CALIBRATIONS)
def test_a_file_is_read_back_as_it_was(
    tmp_path_factory: pytest.TempPathFactory, calibration: Calibration
) -> None:
    path = tmp_path_factory.mktemp("calibration") / "glove.toml"
    save_calibration(calibration, path)
    assert load_calibration(path) == calibration


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("kick_ms = 40", "kick_ms = 400", "kick_ms must be 0 to 100, not 400"),
        ("kick_ms = 40", "kick = 40", "did you mean 'kick_ms'?"),
        ("supply_v = 5.0", "supply_v = 50.0", "supply_v must be more than 0 and at most 12"),
        ("max_v = 3.8", "max_v = 0.0", "max_v must be more than 0"),
        ("max_v = 3.8", "max_v = 1.0", "max_v 1 is too little for its start_duty"),
        ("start_duty = 0.30", "start_duty = 1.0", "start_duty must be at least 0 and less than 1"),
        ("[0.45, 150.0]", "[0.65, 150.0]", "both duty and frequency must increase"),
        ("[0.45, 150.0]", "[0.0, 150.0]", "a duty must be more than 0"),
        ("[0.45, 150.0]", "[0.45]", "a list of 2 is expected"),
        ("[motors.5]", "[motors.6]", "one for each finger is needed"),
        ("supply_v = 5.0", "supply_v = ", "not valid TOML"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path: Path, old: str, new: str, expected: str) -> None:
    path = tmp_path / "glove.toml"
    path.write_text(SHIPPED.read_text().replace(old, new, 1))
    with pytest.raises(ConfigError) as refused:
        load_calibration(path)
    assert str(path) in str(refused.value)
    assert expected in str(refused.value)


def test_a_file_that_cannot_be_written_is_told() -> None:
    with pytest.raises(ConfigError, match="cannot be written"):
        save_calibration(load_calibration(), Path("/nowhere/glove.toml"))
