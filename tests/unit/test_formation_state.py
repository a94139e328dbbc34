"""The state of a formation: what is extended, growing, displaced or missing, in any formation and any frame."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

from glove_bridge.formation_state import (
    Geometry,
    Memory,
    Reading,
    Scene,
    area_ratio,
    default_geometry,
    neighbour_pairs,
    pair_distances,
    pair_rates,
    right_of,
)
from glove_bridge.meaning import MEANINGS, advice_pattern, state_pattern
from glove_bridge.rules import RULES
from glove_bridge.rules.thresholds import Thresholds
from shared.arrays import Vec, rest_of
from shared.config import load_scenario
from shared.formation import Formation, build_formation
from shared.scenario import FormationSettings, Scenario, Shape

LIMITS = Thresholds()
SHAPES: list[tuple[Shape, int]] = [
    ("rhombus", 4),
    ("triangle", 3),
    ("line", 5),
    ("vee", 7),
    ("grid", 9),
    ("grid", 5),
    ("line", 1),
]
FORMATIONS = [
    build_formation(evolve(load_scenario("grid"), formation=FormationSettings(shape=shape, n=n)))
    for shape, n in SHAPES
]
RHOMBUS, TRIANGLE, LINE = FORMATIONS[0], FORMATIONS[1], FORMATIONS[2]
EVERY_RULE = pytest.mark.parametrize("rule", sorted(RULES))


def default(formation: Formation, hand: tuple[float, float] = (0.0, 0.0)) -> Scene:
    """The formation at rest around a hand, exactly in its default shape."""
    place = rest_of(formation)[:, :2] + np.array(hand)
    return Scene(position=place, velocity=np.zeros_like(place), goal=place, setpoint=place, yaw=0.0)


def whole(formation: Formation) -> Geometry:
    return default_geometry(formation, formation.ids)


def read(
    formation: Formation,
    scene: Scene,
    rule: str = "paper",
    memory: Memory | None = None,
    limits: Thresholds = LIMITS,
) -> Reading:
    return RULES[rule](whole(formation), scene, memory or Memory(), limits)[0]


def scaled(scene: Scene, factor: float) -> Scene:
    def about_centre(points: Vec) -> Vec:
        centre: Vec = points.mean(axis=0)
        return centre + factor * (points - centre)

    return evolve(scene, position=about_centre(scene.position), setpoint=about_centre(scene.setpoint))


def test_neighbours_are_the_sides_of_every_shape() -> None:
    pairs = {
        (shape, n): [(f.ids[i], f.ids[j]) for i, j in whole(f).pairs]
        for (shape, n), f in zip(SHAPES, FORMATIONS, strict=True)
    }
    assert pairs["rhombus", 4] == [(1, 2), (1, 3), (2, 4), (3, 4)]
    assert pairs["triangle", 3] == [(1, 2), (1, 3), (2, 3)]
    assert pairs["line", 5] == [(1, 2), (2, 3), (3, 4), (4, 5)]
    assert pairs["vee", 7] == [(1, 2), (1, 3), (2, 4), (3, 5), (4, 6), (5, 7)]
    assert len(pairs["grid", 9]) == 12
    assert pairs["line", 1] == []


@pytest.mark.parametrize(
    ("factor", "extent"), [(1.0, 0), (1.04, 0), (1.06, 1), (1.5, 1), (0.96, 0), (0.93, -1), (0.5, -1)]
)
def test_the_area_decides_first_it_grows_with_the_square(factor: float, extent: int) -> None:
    reading = read(RHOMBUS, scaled(default(RHOMBUS), factor))
    assert reading.extent == extent
    assert reading.area_ratio == pytest.approx(factor**2)
    assert reading.distances[1, 2] == pytest.approx(factor * math.hypot(0.5, 0.5))


def test_a_line_has_no_area_its_distances_decide() -> None:
    for factor, extent in ((1.0, 0), (1.09, 0), (1.11, 1), (0.91, 0), (0.89, -1)):
        reading = read(LINE, scaled(default(LINE), factor))
        assert (reading.extent, reading.area, reading.area_ratio) == (extent, 0.0, 1.0)


def test_extended_wins_over_contracted() -> None:
    geometry, scene = whole(RHOMBUS), default(RHOMBUS)
    position = scene.position.copy()
    position[1:3, 1] *= 0.2
    position[3, 0] -= 0.6
    reading, _ = RULES["paper"](geometry, evolve(scene, position=position), Memory(), LIMITS)
    assert reading.area_ratio < 0.9
    assert reading.extent == 1


def test_the_trend_has_hysteresis() -> None:
    geometry, scene, memory = whole(RHOMBUS), default(RHOMBUS), Memory()
    centre = scene.position.mean(axis=0)
    trends = []
    for rate in (0.0, 0.05, 0.11, 0.05, 0.02, 0.05, -0.05, -0.11, -0.05, 0.05, 0.11):
        moving = evolve(scene, velocity=rate * (scene.position - centre))
        reading, memory = RULES["paper"](geometry, moving, memory, LIMITS)
        trends.append(reading.trend)
    assert trends == [0, 0, 1, 1, 0, 0, 0, -1, -1, 0, 1]


def test_flying_together_is_no_trend() -> None:
    scene = evolve(default(RHOMBUS), velocity=np.tile((0.7, -0.3), (4, 1)))
    assert read(RHOMBUS, scene).trend == 0


@pytest.mark.parametrize(
    ("velocity", "shift", "right"),
    [
        ((-0.5, 0.0), (0.0, 0.2), 0.2),
        ((0.5, 0.0), (0.0, 0.2), -0.2),
        ((0.0, 0.5), (0.2, 0.0), 0.2),
        ((0.0, 0.5), (0.0, -0.3), 0.0),
        ((0.01, 0.0), (0.0, 0.2), 0.2),
    ],
)
def test_right_and_left_are_seen_along_the_motion_of_the_drones(
    velocity: tuple[float, float], shift: tuple[float, float], right: float
) -> None:
    scene = default(RHOMBUS, hand=(3.0, -1.0))
    moved = evolve(scene, position=scene.position + np.array(shift), velocity=np.tile(velocity, (4, 1)))
    reading = read(RHOMBUS, moved)
    assert reading.displacement == pytest.approx(right, abs=1e-9)
    assert reading.side == (right > 0.05) - (right < -0.05)


def test_while_hovering_the_last_direction_counts() -> None:
    geometry, scene = whole(RHOMBUS), default(RHOMBUS)
    moving = evolve(scene, velocity=np.tile((0.0, 0.5), (4, 1)))
    _, memory = RULES["paper"](geometry, moving, Memory(), LIMITS)
    hovering = evolve(scene, position=scene.position + np.array((0.2, 0.0)))
    assert RULES["paper"](geometry, hovering, memory, LIMITS)[0].displacement == pytest.approx(0.2)
    assert RULES["paper"](geometry, hovering, Memory(), LIMITS)[0].displacement == pytest.approx(0.0)


def test_a_missing_drone_is_left_out_of_the_default_too() -> None:
    for gone in RHOMBUS.ids:
        ids = [drone for drone in RHOMBUS.ids if drone != gone]
        rows = [RHOMBUS.row(drone) for drone in ids]
        place = rest_of(RHOMBUS)[rows, :2]
        scene = Scene(position=place, velocity=0 * place, goal=place, setpoint=place, yaw=0.0)
        for rule in RULES.values():
            reading, _ = rule(default_geometry(RHOMBUS, ids), scene, Memory(), LIMITS)
            assert (reading.extent, reading.side, reading.trend) == (0, 0, 0)
            assert reading.displacement == pytest.approx(0.0)


def test_the_default_area_of_2018_is_that_of_the_equilateral_triangle() -> None:
    flown = FormationSettings(shape="triangle", n=3, spacing=0.344, width=0.4)
    formation = build_formation(Scenario(formation=flown))
    assert read(formation, default(formation), "flight-2018").area_ratio == pytest.approx(0.0688 / 0.0692820)
    assert read(TRIANGLE, default(TRIANGLE), "flight-2018").area_ratio == pytest.approx(1.0)


def test_a_wide_gap_across_extends_in_2018() -> None:
    scene = default(TRIANGLE)
    setpoint = scene.setpoint.copy()
    setpoint[1:, 0] += 0.1
    setpoint[1:, 1] *= 1.08
    reading = read(TRIANGLE, evolve(scene, setpoint=setpoint), "flight-2018")
    assert reading.area_ratio < 0.9
    assert reading.extent == 1


def test_rates_of_drones_on_one_spot_are_finite() -> None:
    assert pair_rates(np.zeros((2, 2)), np.eye(2), ((0, 1),)).tolist() == [0.0]
    assert area_ratio(0.3, 0.0) == 1.0
    assert right_of(np.array((0.0, 1.0))).tolist() == [1.0, -0.0]


def test_neighbours_do_not_depend_on_the_scale() -> None:
    grid = np.array([(x, y) for x in range(3) for y in range(3)], dtype=np.float64)
    assert neighbour_pairs(grid) == neighbour_pairs(1e-2 * grid) == neighbour_pairs(1e3 * grid + 17.0)


class Flown(NamedTuple):
    """A formation and any scene of it, with some noise: exactly on a threshold, rounding decides."""

    formation: Formation
    scene: Scene


@st.composite
def flights(draw: st.DrawFn) -> Flown:
    formation = draw(st.sampled_from(FORMATIONS))
    count = len(formation.ids)
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    place, amount = rest_of(formation)[:, :2] * draw(st.floats(0.6, 1.6)), draw(st.floats(0.01, 0.3))
    scene = Scene(
        position=place + amount * random.normal(size=(count, 2)),
        velocity=draw(st.floats(-1, 1)) * (place - place.mean(axis=0)) + random.normal(size=2),
        goal=rest_of(formation)[:, :2] + 0.1 * amount * random.normal(size=(count, 2)),
        setpoint=place + amount * random.normal(size=(count, 2)),
        yaw=0.0,
    )
    return Flown(formation, scene)


def turned(scene: Scene, angle: float, shift: Vec) -> Scene:
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array(((c, s), (-s, c)))
    return Scene(
        position=scene.position @ turn + shift,
        velocity=scene.velocity @ turn,
        goal=scene.goal @ turn + shift,
        setpoint=scene.setpoint @ turn + shift,
        yaw=scene.yaw + angle,
    )


def mirrored(scene: Scene) -> Scene:
    flip = np.array((1.0, -1.0))
    return Scene(
        position=scene.position * flip,
        velocity=scene.velocity * flip,
        goal=scene.goal * flip,
        setpoint=scene.setpoint * flip,
        yaw=-scene.yaw,
    )


def mirrored_geometry(geometry: Geometry) -> Geometry:
    return evolve(geometry, rest=geometry.rest * np.array((1.0, -1.0)))


@EVERY_RULE
@given(flown=flights(), angle=st.floats(-7, 7), x=st.floats(-50, 50), y=st.floats(-50, 50))
def test_turning_and_moving_the_whole_scene_changes_no_pattern(
    rule: str, flown: Flown, angle: float, x: float, y: float
) -> None:
    before = read(flown.formation, flown.scene, rule)
    after = read(flown.formation, turned(flown.scene, angle, np.array((x, y))), rule)
    assert after.displacement == pytest.approx(before.displacement, abs=1e-9)
    assert after.area == pytest.approx(before.area, abs=1e-9)
    assert [choose(after) for choose in MEANINGS.values()] == [choose(before) for choose in MEANINGS.values()]


MIRROR = {"R": "L", "L": "R", "CR": "CL", "CL": "CR", "ER": "EL", "EL": "ER"}


@EVERY_RULE
@given(flown=flights())
def test_mirroring_swaps_right_and_left(rule: str, flown: Flown) -> None:
    geometry = whole(flown.formation)
    before, _ = RULES[rule](geometry, flown.scene, Memory(), LIMITS)
    after, _ = RULES[rule](mirrored_geometry(geometry), mirrored(flown.scene), Memory(), LIMITS)
    for choose in MEANINGS.values():
        name = choose(before)
        assert choose(after) == (MIRROR.get(name, name) if name else None)


@EVERY_RULE
@given(flown=flights(), factor=st.floats(1.0, 3.0))
def test_scaling_up_never_contracts(rule: str, flown: Flown, factor: float) -> None:
    before, after = (read(flown.formation, scene, rule) for scene in (flown.scene, scaled(flown.scene, factor)))
    assert after.extent >= before.extent


@EVERY_RULE
@given(flown=flights(), seed=st.integers(0, 2**32 - 1))
def test_numbering_the_drones_otherwise_changes_nothing(rule: str, flown: Flown, seed: int) -> None:
    geometry, scene = whole(flown.formation), flown.scene
    order = np.random.default_rng(seed).permutation(len(geometry.ids))
    place = {int(old): new for new, old in enumerate(order)}
    rest = geometry.rest[order]
    renumbered = evolve(
        geometry,
        rest=rest,
        rooted=tuple(sorted(place[row] for row in geometry.rooted)),
        pairs=neighbour_pairs(rest),
        gaps=pair_distances(rest, neighbour_pairs(rest)),
    )
    shuffled = Scene(
        position=scene.position[order],
        velocity=scene.velocity[order],
        goal=scene.goal[order],
        setpoint=scene.setpoint[order],
        yaw=0.0,
    )
    before, _ = RULES[rule](geometry, scene, Memory(), LIMITS)
    after, _ = RULES[rule](renumbered, shuffled, Memory(), LIMITS)
    assert after.displacement == pytest.approx(before.displacement, abs=1e-9)
    assert state_pattern(after) == state_pattern(before)
    assert advice_pattern(after) == advice_pattern(before)


def reading(extent: int = 0, trend: int = 0, side: int = 0) -> Reading:
    return Reading(
        area=1.0, area_ratio=1.0, distances={}, extent=extent, trend=trend, displacement=0.1 * side, side=side
    )


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        (reading(), None),
        (reading(1, 1), "EI"),
        (reading(1, -1), "ED"),
        (reading(0, 1), "RI"),
        (reading(0, -1), "RD"),
        (reading(-1, 1), "CI"),
        (reading(-1, -1), "CD"),
        (reading(-1, 0), None),
        (reading(side=1), "R"),
        (reading(side=-1), "L"),
        (reading(0, 1, 1), "R"),
        (reading(1, 0, -1), "L"),
        (reading(-1, -1, 1), "CD"),
    ],
)
def test_the_eight_patterns_of_the_paper(state: Reading, expected: str | None) -> None:
    assert state_pattern(state) == expected


@pytest.mark.parametrize(
    ("extent", "side", "expected"),
    [(-1, -1, "CL"), (-1, 1, "CR"), (1, 1, "EL"), (1, -1, "ER"), (0, 1, None), (-1, 0, None), (1, 0, None)],
)
def test_the_recommended_hand_motion(extent: int, side: int, expected: str | None) -> None:
    assert advice_pattern(reading(extent, 0, side)) == expected
