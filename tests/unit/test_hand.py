"""The mapped hand: mapping, clamps, chase and turn (agents/control/hand.py)."""

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.hand import (
    MAX_SAMPLE_GAP,
    OUTERMOST_SPEED,
    HandInput,
    HandSettings,
    MappedHand,
    freeze,
    map_hand,
)
from agents.settings import hand_settings, mapping
from shared.config import load_scenario
from shared.formation import build_formation
from shared.messages import MAX_POSITION, MAX_VELOCITY
from shared.scenario import Hand
from tests.values import vector

Vec = npt.NDArray[np.float64]
Points = Sequence[float] | Vec

TICK = 1.0 / 60.0
FAR = np.full(3, 1e4)
coordinates = st.floats(-3.0, 3.0).map(lambda x: round(x, 6))
points = st.tuples(coordinates, coordinates, coordinates)
gaps = st.floats(0.0, 0.3)


def settings(radius: float = 1.5, low: Vec = -FAR, high: Vec = FAR, **hand: Any) -> HandSettings:
    return mapping(Hand(**hand), vector(low), vector(high), radius)


def sample(
    position: Points, velocity: Points = (0.0, 0.0, 0.0), yaw: float = 0.0, stamp: float = 0.0
) -> HandInput:
    return HandInput(position=vector(position), velocity=vector(velocity), yaw=yaw, stamp=stamp)


def follow(samples: Sequence[HandInput], rules: HandSettings) -> list[MappedHand]:
    mapped: list[MappedHand] = []
    for one in samples:
        mapped.append(map_hand(mapped[-1] if mapped else None, one, rules))
    return mapped


def test_an_absolute_mapping_is_the_hand_itself() -> None:
    mapped = map_hand(None, sample((0.1, -0.2, 1.3), (0.3, 0.2, -0.1), yaw=0.4, stamp=5.0), settings())
    assert list(mapped.point) == [0.1, -0.2, 1.3]
    assert list(mapped.velocity) == [0.3, 0.2, -0.1]
    assert (mapped.yaw, mapped.yaw_rate, mapped.stamp) == (0.4, 0.0, 5.0)


def test_a_relative_mapping_scales_way_and_velocity() -> None:
    rules = settings(mapping="relative", gain=2.0, offset=(1.0, -1.0, 0.5))
    mapped = map_hand(None, sample((0.1, -0.2, 0.3), (0.1, 0.2, -0.1)), rules)
    assert mapped.point == pytest.approx([1.2, -1.4, 1.1])
    assert mapped.velocity == pytest.approx([0.2, 0.4, -0.2])


def test_a_fixed_height_has_no_vertical_velocity() -> None:
    mapped = map_hand(None, sample((0.1, -0.2, 1.9), (0.1, 0.2, 0.3)), settings(height=1.2))
    assert list(mapped.point) == [0.1, -0.2, 1.2]
    assert list(mapped.velocity) == [0.1, 0.2, 0.0]


def test_a_clamped_axis_has_no_velocity() -> None:
    box = settings(low=np.array([-1.0, -1.0, 0.5]), high=np.array([1.0, 1.0, 2.0]))
    mapped = map_hand(None, sample((1.5, 0.2, 0.4), (0.3, 0.2, -0.1)), box)
    assert list(mapped.point) == [1.0, 0.2, 0.5]
    assert list(mapped.velocity) == [0.0, 0.2, 0.0]


def test_the_clip_of_a_scenario_bounds_x_and_y_only() -> None:
    overrides = ["hand.clip.min=[-1.0, -0.5]", "hand.clip.max=[1.0, 0.5]"]
    scenario = load_scenario("rhombus", overrides)
    rules = hand_settings(scenario, build_formation(scenario))
    mapped = map_hand(None, sample((-7.0, 0.7, 9.0)), rules)
    assert list(mapped.point) == [-1.0, 0.5, 9.0]


def test_without_a_clip_the_whole_formation_stays_inside_the_fence() -> None:
    scenario = load_scenario("rhombus", ["fence.min=[-4, -3, -0.1]", "fence.max=[3, 3, 3]"])
    formation = build_formation(scenario)
    rules = hand_settings(scenario, formation)
    for corner in ((-99.0, -99.0, -99.0), (99.0, 99.0, 99.0)):
        mapped = map_hand(None, sample(corner), rules)
        places = formation.rest + np.array(mapped.point)
        assert (places >= np.array([-3.85, -2.85, -0.1]) - 1e-9).all()
        assert (places <= np.array([2.85, 2.85, 2.85]) + 1e-9).all()


def test_a_hand_slower_than_the_limit_is_followed_exactly() -> None:
    velocity = np.array([0.5, -0.5, 0.2])
    samples = [sample(velocity * k * TICK, velocity, stamp=k * TICK) for k in range(60)]
    for one, mapped in zip(samples, follow(samples, settings(max_speed=0.75)), strict=True):
        assert list(mapped.point) == list(one.position)
        assert list(mapped.velocity) == velocity.tolist()


def test_a_hand_that_jumps_is_chased_at_the_limit_and_met() -> None:
    there = sample((3.0, 4.0, 0.0), (0.1, 0.0, 0.0))
    samples = [
        sample((0.0, 0.0, 0.0)),
        *(sample(there.position, there.velocity, stamp=0.1 * k) for k in range(1, 52)),
    ]
    mapped = follow(samples, settings(max_speed=1.0))
    assert mapped[10].point == pytest.approx([0.6, 0.8, 0.0])
    assert mapped[10].velocity == pytest.approx([0.6, 0.8, 0.0])
    assert math.dist(mapped[49].point, there.position) == pytest.approx(0.1)
    assert list(mapped[51].point) == [3.0, 4.0, 0.0]
    assert list(mapped[51].velocity) == [0.1, 0.0, 0.0]


def test_a_wild_velocity_of_a_slow_hand_is_cut_to_the_limit() -> None:
    samples = [sample((0.0, 0.0, 0.0)), sample((0.001, 0.0, 0.0), (0.0, 30.0, 40.0), stamp=TICK)]
    assert follow(samples, settings(max_speed=0.5))[-1].velocity == pytest.approx([0.0, 0.3, 0.4])


@given(steps=st.lists(st.tuples(points, points, gaps), min_size=2, max_size=20))
def test_the_mapped_hand_is_never_faster_than_the_limit_by_the_stamps(
    steps: list[tuple[tuple[float, ...], tuple[float, ...], float]],
) -> None:
    stamps = np.cumsum([gap for *_, gap in steps])
    samples = [sample(p, v, stamp=float(t)) for (p, v, _), t in zip(steps, stamps, strict=True)]
    mapped = follow(samples, settings(max_speed=0.75))
    for before, after in itertools.pairwise(mapped):
        way = math.dist(after.point, before.point)
        assert way <= 0.75 * min(after.stamp - before.stamp, MAX_SAMPLE_GAP) + 1e-9
        assert np.linalg.norm(after.velocity) <= 0.75 + 1e-9


@given(parts=st.lists(st.floats(0.001, 0.1), min_size=1, max_size=20), start=points)
def test_the_way_to_a_hand_depends_on_the_time_and_not_on_the_number_of_samples(
    parts: list[float], start: tuple[float, ...]
) -> None:
    """Whoever loses a sample is where the others are, as long as no gap is longer than granted."""
    seconds = sum(parts)
    target, rules = np.array([40.0, 30.0, 0.0]), settings(max_speed=0.75)
    mapped = follow([sample(start), *(sample(target, stamp=t) for t in np.cumsum(parts).tolist())], rules)[-1]
    heading = (target - start) / np.linalg.norm(target - start)
    assert np.allclose(mapped.point, start + heading * 0.75 * seconds, atol=1e-9)


@given(steps=st.lists(st.tuples(points, gaps), min_size=2, max_size=12), shift=st.integers(-1_000, 1_000))
def test_only_differences_of_stamps_count(steps: list[tuple[tuple[float, ...], float]], shift: int) -> None:
    stamps = np.cumsum([gap for _, gap in steps])
    here, there = (
        follow([sample(p, stamp=float(t) + s) for (p, _), t in zip(steps, stamps, strict=True)], settings())
        for s in (0, shift)
    )
    assert np.allclose([m.point for m in here], [m.point for m in there], atol=1e-9)


@pytest.mark.parametrize(("gap", "granted"), [(0.05, 0.05), (5.0, MAX_SAMPLE_GAP), (0.0, 0.0), (-3.0, 0.0)])
def test_a_gap_grants_at_most_its_bound(gap: float, granted: float) -> None:
    samples = [sample((0.0, 0.0, 0.0)), sample((9.0, 0.0, 0.0), yaw=3.0, stamp=gap)]
    mapped = follow(samples, settings(max_speed=0.75, radius=2.0))[-1]
    assert mapped.point == pytest.approx([0.75 * granted, 0.0, 0.0])
    assert mapped.yaw == pytest.approx(0.5 * granted)


@given(
    turns=st.lists(st.tuples(st.floats(-1_000.0, 1_000.0), gaps), min_size=2, max_size=20),
    radius=st.floats(0.0, 20.0),
)
def test_the_outermost_drone_turns_at_no_more_than_its_speed(
    turns: list[tuple[float, float]], radius: float
) -> None:
    stamps = np.cumsum([gap for _, gap in turns])
    samples = [sample((0, 0, 0), yaw=yaw, stamp=float(t)) for (yaw, _), t in zip(turns, stamps, strict=True)]
    mapped = follow(samples, settings(radius=radius))
    for before, after in itertools.pairwise(mapped):
        turned = abs(math.remainder(after.yaw - before.yaw, math.tau))
        granted = min(after.stamp - before.stamp, MAX_SAMPLE_GAP)
        assert radius * turned <= OUTERMOST_SPEED * granted + 1e-9
        assert radius * abs(after.yaw_rate) <= OUTERMOST_SPEED + 1e-9


@pytest.mark.parametrize(
    ("start", "target", "sign"),
    [(3.0, -3.0, 1), (-3.0, 3.0, -1), (0.0, 3.0, 1), (0.0, -3.0, -1), (0.0, 6.0, -1)],
)
def test_it_turns_the_shortest_way_round_and_arrives(start: float, target: float, sign: int) -> None:
    samples = [
        sample((0, 0, 0), yaw=start),
        *(sample((0, 0, 0), yaw=target, stamp=k * TICK) for k in range(1, 400)),
    ]
    mapped = follow(samples, settings(radius=1.0))
    assert mapped[1].yaw_rate == pytest.approx(sign * 1.0)
    assert mapped[1].yaw == pytest.approx(start + sign * TICK)
    assert math.remainder(mapped[-1].yaw - target, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert mapped[-1].yaw_rate == 0.0


def test_a_slow_turn_is_followed_with_its_rate() -> None:
    samples = [sample((0, 0, 0), yaw=0.3 * k * TICK, stamp=k * TICK) for k in range(30)]
    last = follow(samples, settings(radius=2.0))[-1]
    assert last.yaw == samples[-1].yaw
    assert last.yaw_rate == pytest.approx(0.3)


def test_a_fixed_heading_ignores_the_yaw() -> None:
    samples = [sample((0, 0, 0), yaw=1.0), sample((0, 0, 0), yaw=2.0, stamp=TICK)]
    assert [(m.yaw, m.yaw_rate) for m in follow(samples, settings(follow_yaw=False))] == [(0.0, 0.0)] * 2


def test_a_frozen_hand_rests_where_it_is() -> None:
    samples = [sample((0, 0, 0), (0.5, 0, 0)), sample((1, 2, 3), (0.5, 0, 0), yaw=1.0, stamp=TICK)]
    moving = follow(samples, settings())[-1]
    frozen = freeze(moving)
    assert any(moving.velocity)
    assert moving.yaw_rate
    assert list(frozen.point) == list(moving.point)
    assert (frozen.yaw, frozen.stamp) == (moving.yaw, moving.stamp)
    assert (list(frozen.velocity), frozen.yaw_rate) == ([0.0, 0.0, 0.0], 0.0)


anywhere = st.tuples(*[st.floats(-MAX_POSITION, MAX_POSITION)] * 3)
any_speed = st.tuples(*[st.floats(-MAX_VELOCITY, MAX_VELOCITY)] * 3)
any_sample = st.builds(sample, anywhere, any_speed, st.floats(-1_000.0, 1_000.0), st.floats(0.0, 1e10))


@given(samples=st.lists(any_sample, min_size=1, max_size=6), mapping=st.sampled_from(["absolute", "relative"]))
def test_any_input_in_range_gives_finite_numbers_inside_the_box(samples: list[HandInput], mapping: str) -> None:
    low, high = np.array([-2.0, -2.0, 0.0]), np.array([2.0, 2.0, 3.0])
    rules = settings(low=low, high=high, mapping=mapping, gain=3.0, offset=(1.0, 2.0, 3.0))
    for mapped in follow(samples, rules):
        point = np.array(mapped.point)
        assert ((point >= low - 1e-9) & (point <= high + 1e-9)).all()
        assert np.isfinite([*mapped.velocity, mapped.yaw, mapped.yaw_rate]).all()
