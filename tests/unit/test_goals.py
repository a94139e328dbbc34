"""Goals, row by row: Eqs. 11-13 by hand and as a matrix, symmetries, rates (agents/control/goals.py)."""

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

from agents.control.goals import Guide, correction, goal_of
from agents.control.hand import MappedHand
from agents.control.impedance import AT_REST, LinkState
from agents.control.vectors import ORIGIN, Vector
from agents.settings import drone_row
from shared.arrays import offsets_of, weights_of
from shared.config import load_scenario
from shared.formation import Formation, build_formation
from shared.messages import Mode
from shared.scenario import FormationSettings, Scenario
from shared.shapes import HUMAN, generate
from tests.values import vector

Vec = npt.NDArray[np.float64]
States = dict[str, LinkState]
"""Link -> its state."""


@functools.cache
def scenario_of(shape: str, *overrides: str) -> Scenario:
    return load_scenario(shape, ["formation.height_from=references", *overrides])


@functools.cache
def formation_of(shape: str, *overrides: str) -> Formation:
    return build_formation(scenario_of(shape, *overrides))


SCENARIO = scenario_of("rhombus")
RHOMBUS = formation_of("rhombus")
SHAPES = ["rhombus", "line", "vee", "grid"]
HAND = (1.0, 2.0, 1.5)

seeds = st.integers(0, 10_000)
angles = st.floats(-10.0, 10.0)


def links(
    *displacements: Sequence[float], rates: Sequence[Sequence[float]] | None = None
) -> tuple[LinkState, ...]:
    speeds = [(1.0, 1.0, 1.0)] * len(displacements) if rates is None else rates
    return tuple(LinkState(vector(x), vector(v)) for x, v in zip(displacements, speeds, strict=True))


def corrected(drone: int, *states: LinkState, law: str = "paper") -> tuple[Vector, Vector]:
    overrides = (f"swarm.law={law}", "swarm.total_limit=0.5")
    row = drone_row(scenario_of("rhombus", *overrides), formation_of("rhombus", *overrides), drone)
    return correction(row, states)


def mapped(
    point: Sequence[float], velocity: Vector = ORIGIN, yaw: float = 0.0, turning: float = 0.0
) -> MappedHand:
    return MappedHand(vector(point), velocity, yaw, turning, 0.0)


def guides(points: Sequence[Sequence[float]], velocities: Sequence[Sequence[float]]) -> list[Guide]:
    pairs = zip(points, velocities, strict=True)
    return [Guide(vector(point), vector(velocity), Mode.FOLLOW) for point, velocity in pairs]


def rhombus_goal(drone: int, references: Sequence[Sequence[float]], *displacements: Sequence[float]) -> Vector:
    """The goal of one drone of the rhombus with the hand at (1, 2, 1.5), yaw 0."""
    row, lead = drone_row(SCENARIO, RHOMBUS, drone), guides(references, [ORIGIN] * len(references))
    return goal_of(row, links(*displacements), mapped(HAND), lead)[0]


STILL = (0.0, 0.0, 0.0)
ONE, TWO, THREE = (0.4, 2.1, 1.4), (-0.2, 2.5, 1.3), (-0.1, 1.7, 1.5)


def test_the_rhombus_at_rest_row_by_row() -> None:
    assert rhombus_goal(1, [], STILL) == pytest.approx([0.5, 2.0, 1.5])
    assert rhombus_goal(2, [ONE], STILL) == pytest.approx([-0.1, 2.6, 1.4])
    assert rhombus_goal(3, [ONE], STILL) == pytest.approx([-0.1, 1.6, 1.4])
    assert rhombus_goal(4, [TWO, THREE], STILL, STILL) == pytest.approx([-0.65, 2.1, 1.4])


def test_the_rhombus_in_motion_row_by_row() -> None:
    assert rhombus_goal(1, [], (0.10, -0.05, 0.02)) == pytest.approx([0.40, 1.95, 1.52])
    assert rhombus_goal(2, [ONE], (-0.10, 0.20, 0.0)) == pytest.approx([-0.20, 2.80, 1.4])
    assert rhombus_goal(3, [ONE], (0.0, -0.05, -0.1)) == pytest.approx([-0.1, 1.55, 1.3])
    # Both links add up before the sign is taken: 0.10 - 0.25 (clamped from -0.40) = -0.15.
    moved = rhombus_goal(4, [TWO, THREE], (0.10, 0.10, 0.05), (-0.40, 0.05, -0.01))
    assert moved == pytest.approx([-0.80, 2.25, 1.44])


def random_case(formation: Formation, seed: int) -> tuple[Vec, States]:
    """References `[hand, drones...]` and link states, some of them beyond their limits."""
    rng = np.random.default_rng(seed)
    states = {
        link.name: LinkState(vector(rng.uniform(-0.4, 0.4, 3)), vector(rng.uniform(-1.0, 1.0, 3)))
        for link in formation.links
    }
    return rng.uniform(-3.0, 3.0, (1 + len(formation.ids), 3)), states


def solve(
    scenario: Scenario,
    formation: Formation,
    references: Vec,
    states: States,
    yaw: float,
    velocities: Vec | None = None,
    turning: float = 0.0,
) -> tuple[Vec, Vec]:
    """Goals and goal velocities of all drones."""
    moving = np.zeros_like(references) if velocities is None else velocities
    found = []
    for drone in formation.ids:
        row = drone_row(scenario, formation, drone)
        seen = [1 + formation.row(other) for other in formation.references(drone)]
        hand = mapped(references[0], vector(moving[0]), yaw, turning)
        own = tuple(states[link.name] for link in row.links)
        found.append(goal_of(row, own, hand, guides(references[seen].tolist(), moving[seen].tolist())))
    goals, rates = zip(*found, strict=True)
    return np.array(goals), np.array(rates)


def about_z(angle: float) -> Vec:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("law", ["paper", "stable"])
@pytest.mark.parametrize("shape", SHAPES)
@given(seed=seeds, yaw=angles)
def test_the_rows_are_those_of_the_matrix(shape: str, law: str, seed: int, yaw: float) -> None:
    overrides = (f"swarm.law={law}", "formation.n=4")
    formation = formation_of(shape, *overrides)
    references, states = random_case(formation, seed)
    corrections = np.zeros((len(formation.ids), 3))
    for link in formation.links:
        corrections[link.target] += np.clip(states[link.name].displacement, -link.limit, link.limit)
    corrections[:, 0] = -np.abs(corrections[:, 0])
    places = offsets_of(formation) + formation.correction_scale * corrections
    expected = weights_of(formation) @ references + places @ about_z(yaw).T
    assert np.allclose(
        solve(scenario_of(shape, *overrides), formation, references, states, yaw)[0], expected, atol=1e-12
    )


@pytest.mark.parametrize("shape", SHAPES)
def test_the_rest_shape_is_its_own_goal(shape: str) -> None:
    formation = formation_of(shape)
    references = np.vstack([np.zeros(3), formation.rest])
    states = {link.name: AT_REST for link in formation.links}
    at_rest, _ = solve(scenario_of(shape), formation, references, states, 0.0)
    assert np.allclose(at_rest, formation.rest, atol=1e-12)


@given(seed=seeds, yaw=angles, turn=angles, shift=st.tuples(*[st.floats(-5.0, 5.0)] * 3))
def test_turning_and_moving_everything_turns_and_moves_the_goals(
    seed: int, yaw: float, turn: float, shift: tuple[float, ...]
) -> None:
    references, states = random_case(RHOMBUS, seed)
    here, _ = solve(SCENARIO, RHOMBUS, references, states, yaw)
    moved = references @ about_z(turn).T + np.array(shift)
    there, _ = solve(SCENARIO, RHOMBUS, moved, states, yaw + turn)
    assert np.allclose(there, here @ about_z(turn).T + np.array(shift), atol=1e-9)


def renumbered(scenario: Scenario, numbers: dict[str, int]) -> Scenario:
    """The same formation with other numbers on its drones."""
    drones = tuple(
        evolve(
            drone,
            id=numbers[str(drone.id)],
            references=tuple(r if r == HUMAN else str(numbers[r]) for r in drone.references),
        )
        for drone in generate(scenario.formation)
    )
    custom = FormationSettings(shape="custom", drones=drones, height_from="references")
    return evolve(scenario, formation=custom)


@given(seed=seeds, yaw=angles, order=st.permutations([1, 2, 3, 4]))
def test_the_numbers_of_the_drones_do_not_matter(seed: int, yaw: float, order: list[int]) -> None:
    references, states = random_case(RHOMBUS, seed)
    numbers = {str(drone): order[drone - 1] for drone in RHOMBUS.ids}
    other = renumbered(SCENARIO, numbers)
    formation = build_formation(other)

    def renamed(link: str) -> str:
        return "-".join(part if part == HUMAN else str(numbers[part]) for part in link.split("-"))

    rows = [order.index(number) for number in formation.ids]
    permuted = {renamed(name): state for name, state in states.items()}
    expected, _ = solve(SCENARIO, RHOMBUS, references, states, yaw)
    found, _ = solve(other, formation, references[[0, *(1 + row for row in rows)]], permuted, yaw)
    assert np.allclose(found, expected[rows], atol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
@given(seed=seeds)
def test_a_correction_never_leads_towards_the_human_and_has_its_bound(shape: str, seed: int) -> None:
    formation = formation_of(shape)
    _, states = random_case(formation, seed)
    for drone in formation.ids:
        row = drone_row(scenario_of(shape), formation, drone)
        moved, _ = correction(row, tuple(states[link.name] for link in row.links))
        assert moved[0] <= 0.0
        assert max(map(abs, moved)) <= row.scale * sum(link.limit for link in row.links) + 1e-12


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_x_leads_away_whichever_way_the_link_gives_while_y_and_z_keep_their_sign(sign: float) -> None:
    moved, rate = corrected(1, *links((0.1 * sign, 0.2 * sign, 0.05 * sign)))
    assert moved == pytest.approx([-0.1, 0.2 * sign, 0.05 * sign])
    assert rate == pytest.approx([-sign, 1.0, 1.0])


def test_a_clamped_term_has_no_rate_and_the_others_keep_theirs() -> None:
    states = links((0.30, 0.10, -0.9), (0.05, -0.70, 0.1), rates=[(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)])
    moved, rate = corrected(4, *states)
    assert moved == pytest.approx([-0.30, -0.15, -0.15])
    assert rate == pytest.approx([-4.0, 2.0, 6.0])


def test_the_stable_law_scales_corrections_and_rates_alike() -> None:
    # Three hops of 0.25, 0.25 and 2 x 0.25 m sum up to 1 m.
    assert formation_of(
        "rhombus", "swarm.law=stable", "swarm.total_limit=0.5"
    ).correction_scale == pytest.approx(0.5)
    moved, rate = corrected(1, *links((0.1, 0.2, 0.0)), law="stable")
    assert moved == pytest.approx([-0.05, 0.1, 0.0])
    assert rate == pytest.approx([-0.5, 0.5, 0.5])


@pytest.mark.parametrize("law", ["paper", "stable"])
@given(data=st.data(), yaw=angles, yaw_rate=st.floats(-2.0, 2.0), seed=seeds)
def test_the_goal_velocity_is_the_derivative_of_the_goal(
    law: str, data: Any, yaw: float, yaw_rate: float, seed: int
) -> None:
    override = f"swarm.law={law}"
    scenario, formation = scenario_of("rhombus", override), formation_of("rhombus", override)
    rng = np.random.default_rng(seed)
    references, velocities = rng.uniform(-3.0, 3.0, (2, 5, 3))
    # Off the corners of the absolute value and of the clamp: same signs of all links, inside or outside.
    size = data.draw(st.sampled_from([0.1, 0.4])) * rng.uniform(0.8, 1.2, (5, 3))
    displacement, rate = size * rng.choice([-1.0, 1.0], 3), rng.uniform(-1.0, 1.0, (5, 3))

    def states(t: float) -> States:
        pairs = zip(formation.links, displacement + rate * t, rate, strict=True)
        return {link.name: LinkState(vector(x), vector(v)) for link, x, v in pairs}

    def at(t: float) -> Vec:
        return solve(scenario, formation, references + velocities * t, states(t), yaw + yaw_rate * t)[0]

    step = 1e-4
    slope = (at(step) - at(-step)) / (2.0 * step)
    _, found = solve(scenario, formation, references, states(0.0), yaw, velocities, yaw_rate)
    assert np.allclose(found, slope, atol=1e-6)
