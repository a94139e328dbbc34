import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from human_relay.velocity import MAX_GAP, MAX_SPEED, WINDOW, VelocityState, step
from shared.recordings.flight_folder import HAND_FILE, read_track
from tests.replay.flights import ABSENT, flight_folders

Vec = npt.NDArray[np.float64]

coordinates = st.floats(-2.0, 2.0)
points = st.tuples(coordinates, coordinates, coordinates)
speeds = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
gaps = st.lists(st.floats(0.005, 0.06), min_size=WINDOW, max_size=30)


def estimate(positions: Vec, gaps: Vec) -> Vec:
    """Runs the estimator over (n, 3) samples that are `gaps` (n,) apart."""
    state, velocities = VelocityState(), []
    for (x, y, z), dt in zip(positions.tolist(), gaps.tolist(), strict=True):
        state, velocity = step(state, (x, y, z), dt)
        velocities.append(velocity)
    return np.array(velocities)


def wander(seed: int, gaps: Vec) -> Vec:
    """A smooth random hand, slower than 1 m/s."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(gaps)[:, None, None]
    rate, phase = rng.uniform(0.5, 3.0, (3, 4)), rng.uniform(0.0, math.tau, (3, 4))
    waves: Vec = np.sum(0.04 * np.sin(rate * t + phase), axis=-1)
    return waves


@given(start=points, velocity=speeds, gaps=gaps)
def test_a_constant_velocity_is_exact_at_any_sampling(
    start: tuple[float, ...], velocity: tuple[float, ...], gaps: list[float]
) -> None:
    t = np.cumsum(gaps)[:, None]
    estimated = estimate(np.array(start) + t * np.array(velocity), np.array(gaps))
    assert np.allclose(estimated[2:], velocity, atol=1e-8)


@given(seed=st.integers(0, 999), gaps=gaps)
def test_the_slope_is_that_of_the_least_squares_parabola(seed: int, gaps: list[float]) -> None:
    positions = wander(seed, np.array(gaps))
    times = np.cumsum(gaps)[-WINDOW:]
    powers = np.vander((times - times[-1]) / (times[-1] - times[0]), 3, increasing=True)
    fitted = np.linalg.lstsq(powers, positions[-WINDOW:])[0][1] / (times[-1] - times[0])
    assert np.allclose(estimate(positions, np.array(gaps))[-1], fitted, atol=1e-9)


def test_a_constant_acceleration_is_exact_once_the_window_is_full() -> None:
    t = np.arange(20) / 60
    positions = np.outer(0.5 * t**2, (1.0, -2.0, 0.5))
    estimated = estimate(positions, np.full(20, 1 / 60))
    assert np.allclose(estimated[WINDOW - 1 :], np.outer(t, (1.0, -2.0, 0.5))[WINDOW - 1 :], atol=1e-9)


@given(seed=st.integers(0, 999), shift=points, gaps=gaps)
def test_moving_the_origin_changes_nothing(seed: int, shift: tuple[float, ...], gaps: list[float]) -> None:
    positions = wander(seed, np.array(gaps))
    here, there = (estimate(p, np.array(gaps)) for p in (positions, positions + np.array(shift)))
    assert np.allclose(here, there, atol=1e-9)


@given(seed=st.integers(0, 999), angle=st.floats(-math.pi, math.pi), gaps=gaps)
def test_turning_the_hand_turns_its_velocity(seed: int, angle: float, gaps: list[float]) -> None:
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    positions = wander(seed, np.array(gaps))
    straight, turned = (estimate(p, np.array(gaps)) for p in (positions, positions @ turn.T))
    assert np.allclose(straight @ turn.T, turned, atol=1e-9)


anything = st.floats(allow_nan=True, allow_infinity=True)


@given(st.lists(st.tuples(anything, anything, anything, anything), max_size=40))
def test_the_velocity_is_always_finite_and_bounded(samples: list[tuple[float, ...]]) -> None:
    table = np.array(samples).reshape(-1, 4)
    with np.errstate(all="ignore"):
        estimated = estimate(table[:, :3], table[:, 3])
    assert np.all(np.linalg.norm(estimated.reshape(-1, 3), axis=1) <= MAX_SPEED * (1 + 1e-9))


def test_a_lost_frame_leaves_no_trace() -> None:
    gaps = np.full(30, 1 / 60)
    gaps[15] = 2 / 60
    positions = np.outer(np.cumsum(gaps), (0.4, 0.1, 0.0))
    assert np.allclose(estimate(positions, gaps)[2:], (0.4, 0.1, 0.0))


@pytest.mark.parametrize(
    ("jump", "pause"), [(0.5, 1 / 60), (0.0, 2 * MAX_GAP), (0.5, 2 * MAX_GAP)], ids=["jump", "gap", "both"]
)
def test_a_gap_or_a_jump_starts_from_rest_without_a_spike(jump: float, pause: float) -> None:
    gaps = np.full(40, 1 / 60)
    gaps[20] = pause
    positions = np.outer(np.cumsum(np.full(40, 1 / 60)), (0.4, 0.0, 0.0))
    positions[20:, 1] += jump
    estimated = estimate(positions, gaps)
    assert np.array_equal(estimated[20:22], np.zeros((2, 3)))
    assert np.allclose(estimated[22:], (0.4, 0.0, 0.0))


def test_a_repeated_stamp_changes_nothing() -> None:
    state = VelocityState()
    for tick in range(12):
        state, velocity = step(state, (0.3 * tick / 60, 0.0, 0.0), 1 / 60)
    again, same = step(state, (9.0, 9.0, 9.0), 0.0)
    assert again is state
    assert same == velocity


def centred_slope(positions: Vec) -> Vec:
    """Zero-phase reference: derivative of a cubic fitted to 15 samples around each, (n - 14, 3) m/s."""
    t = np.arange(-7, 8) / 60
    kernel = np.linalg.pinv(np.vander(t, 4, increasing=True))[1]
    return np.stack([np.convolve(axis, kernel[::-1], "valid") for axis in positions.T], axis=1)


def recorded_hand(folder: Path) -> tuple[Vec, Vec]:
    track = read_track(folder / HAND_FILE)
    return track.position, np.diff(track.t_ns, prepend=track.t_ns[0]) / 1e9


def delayed(truth: Vec, samples: float) -> Vec:
    """The reference as it was so many (fractional) samples earlier."""
    index = np.arange(len(truth))
    return np.stack([np.interp(index - samples, index, axis) for axis in truth.T], axis=1)


def test_the_recorded_hands_give_the_documented_figures() -> None:
    """Noise 28 mm/s per mm, 5.9 mm/s RMS, delay 12.5 ms (tactile hands, all samples together)."""
    rng = np.random.default_rng(1)
    delays_ms = np.arange(0.0, 40.0, 1.0)
    squares = np.zeros(len(delays_ms))
    noise: list[Vec] = []
    count = 0
    folders = flight_folders("tactile")
    if not folders:
        pytest.skip(ABSENT)
    for folder in folders:
        positions, gaps = recorded_hand(folder)
        estimated = estimate(positions, gaps)
        noisy = estimate(positions + rng.normal(0.0, 1e-3, positions.shape), gaps)
        noise.append((noisy - estimated)[WINDOW:])
        truth = centred_slope(positions)
        errors = [(estimated[7:-7] - delayed(truth, ms * 60e-3))[WINDOW:] for ms in delays_ms]
        squares += [np.sum(error**2) for error in errors]
        count += len(errors[0])
    assert 1e3 * np.std(np.concatenate(noise)) == pytest.approx(28.0, rel=0.05)
    assert 1e3 * np.sqrt(squares[0] / count) == pytest.approx(5.9, rel=0.15)
    assert delays_ms[np.argmin(squares)] == pytest.approx(12.5, abs=5.0)
