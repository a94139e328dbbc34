"""Goals, row by row: Eqs. 11-13 by hand, symmetries, corrections and rates (agents/control/goals.py)."""

import functools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

from agents.control.goals import (
    Rows,
    agent_row,
    all_rows,
    corrections,
    goal_velocities,
    goals,
    place_velocities,
    rotate,
)
from agents.control.impedance import LinkState, rest_state
from shared.config import load_scenario
from shared.formation import Formation, build_formation
from shared.scenario import FormationSettings, Scenario
from shared.shapes import HUMAN, generate

Vec = npt.NDArray[np.float64]


@functools.cache
def formation_of(shape: str, *overrides: str) -> Formation:
    return build_formation(load_scenario(shape, overrides))


SCENARIO = load_scenario("rhombus")
RHOMBUS = formation_of("rhombus")
SHAPES = ["rhombus", "line", "vee", "grid"]
HAND = (1.0, 2.0, 1.5)

seeds = st.integers(0, 10_000)
angles = st.floats(-10.0, 10.0)


def links(*displacements: Sequence[float], rates: Sequence[Sequence[float]] | None = None) -> LinkState:
    x = np.array(displacements, dtype=np.float64)
    return LinkState(displacement=x, rate=np.ones_like(x) if rates is None else np.array(rates))


def rhombus_goal(
    drone: int, references: Sequence[Sequence[float]], *displacements: Sequence[float]
) -> list[float]:
    """The goal of one drone of the rhombus with the hand at (1, 2, 1.5), yaw 0."""
    row = agent_row(RHOMBUS, drone)
    correction, _ = corrections(row, links(*displacements))
    goal: list[float] = goals(row, np.array([HAND, *references]), correction, 0.0)[0].tolist()
    return goal


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


def random_case(formation: Formation, seed: int) -> tuple[Vec, LinkState]:
    """References `[hand, drones...]` and link states, some of them beyond their limits."""
    rng = np.random.default_rng(seed)
    count = len(formation.links)
    state = LinkState(displacement=rng.uniform(-0.4, 0.4, (count, 3)), rate=rng.uniform(-1.0, 1.0, (count, 3)))
    return rng.uniform(-3.0, 3.0, (1 + len(formation.ids), 3)), state


def solve(rows: Rows, references: Vec, state: LinkState, yaw: float) -> Vec:
    return goals(rows, references, corrections(rows, state)[0], yaw)


@pytest.mark.parametrize("law", ["paper", "stable"])
@pytest.mark.parametrize("shape", SHAPES)
@given(seed=seeds, yaw=angles)
def test_the_matrix_is_the_rows_of_the_agents(shape: str, law: str, seed: int, yaw: float) -> None:
    formation = formation_of(shape, f"swarm.law={law}", "formation.n=4")
    references, state = random_case(formation, seed)
    together = solve(all_rows(formation), references, state, yaw)
    for drone, goal in zip(formation.ids, together, strict=True):
        seen = [0, *(1 + formation.row(other) for other in formation.references(drone))]
        own = [formation.links.index(link) for link in formation.links_into(drone)]
        mine = LinkState(displacement=state.displacement[own], rate=state.rate[own])
        assert np.allclose(solve(agent_row(formation, drone), references[seen], mine, yaw)[0], goal, atol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_rest_shape_is_its_own_goal(shape: str) -> None:
    formation = formation_of(shape)
    references = np.vstack([np.zeros(3), formation.rest])
    at_rest = solve(all_rows(formation), references, rest_state(len(formation.links)), 0.0)
    assert np.allclose(at_rest, formation.rest, atol=1e-12)


@given(seed=seeds, yaw=angles, turn=angles, shift=st.tuples(*[st.floats(-5.0, 5.0)] * 3))
def test_turning_and_moving_everything_turns_and_moves_the_goals(
    seed: int, yaw: float, turn: float, shift: tuple[float, ...]
) -> None:
    rows = all_rows(RHOMBUS)
    references, state = random_case(RHOMBUS, seed)
    here = solve(rows, references, state, yaw)
    there = solve(rows, rotate(references, turn) + np.array(shift), state, yaw + turn)
    assert np.allclose(there, rotate(here, turn) + np.array(shift), atol=1e-9)


def renumbered(scenario: Scenario, numbers: dict[str, int]) -> Formation:
    """The same formation with other numbers on its drones."""
    drones = tuple(
        evolve(
            drone,
            id=numbers[str(drone.id)],
            references=tuple(r if r == HUMAN else str(numbers[r]) for r in drone.references),
        )
        for drone in generate(scenario.formation)
    )
    return build_formation(evolve(scenario, formation=FormationSettings(shape="custom", drones=drones)))


@given(seed=seeds, yaw=angles, order=st.permutations([1, 2, 3, 4]))
def test_the_numbers_of_the_drones_do_not_matter(seed: int, yaw: float, order: list[int]) -> None:
    references, state = random_case(RHOMBUS, seed)
    numbers = {str(drone): order[drone - 1] for drone in RHOMBUS.ids}
    other = renumbered(SCENARIO, numbers)

    def renamed(link: str) -> str:
        return "-".join(part if part == HUMAN else str(numbers[part]) for part in link.split("-"))

    rows = [order.index(number) for number in other.ids]
    names = [renamed(link.name) for link in RHOMBUS.links]
    moved = [names.index(link.name) for link in other.links]
    permuted = LinkState(displacement=state.displacement[moved], rate=state.rate[moved])
    expected = solve(all_rows(RHOMBUS), references, state, yaw)[rows]
    found = solve(all_rows(other), references[[0, *(1 + row for row in rows)]], permuted, yaw)
    assert np.allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
@given(seed=seeds)
def test_a_correction_never_leads_towards_the_human_and_has_its_bound(shape: str, seed: int) -> None:
    formation = formation_of(shape)
    _, state = random_case(formation, seed)
    rows = all_rows(formation)
    correction, _ = corrections(rows, state)
    assert (correction[:, 0] <= 0.0).all()
    assert (np.abs(correction) <= rows.scale * rows.sum_links(rows.limits) + 1e-12).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_x_leads_away_whichever_way_the_link_gives_while_y_and_z_keep_their_sign(sign: float) -> None:
    correction, rate = corrections(agent_row(RHOMBUS, 1), links((0.1 * sign, 0.2 * sign, 0.05 * sign)))
    assert correction[0] == pytest.approx([-0.1, 0.2 * sign, 0.05 * sign])
    assert rate[0] == pytest.approx([-sign, 1.0, 1.0])


def test_a_clamped_term_has_no_rate_and_the_others_keep_theirs() -> None:
    correction, rate = corrections(
        agent_row(RHOMBUS, 4),
        links((0.30, 0.10, -0.9), (0.05, -0.70, 0.1), rates=[(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]),
    )
    assert correction[0] == pytest.approx([-0.30, -0.15, -0.15])
    assert rate[0] == pytest.approx([-4.0, 2.0, 6.0])


def test_the_stable_law_scales_corrections_and_rates_alike() -> None:
    formation = formation_of("rhombus", "swarm.law=stable", "swarm.total_limit=0.5")
    # Three hops of 0.25, 0.25 and 2 x 0.25 m sum up to 1 m.
    assert formation.correction_scale == pytest.approx(0.5)
    correction, rate = corrections(agent_row(formation, 1), links((0.1, 0.2, 0.0)))
    assert correction[0] == pytest.approx([-0.05, 0.1, 0.0])
    assert rate[0] == pytest.approx([-0.5, 0.5, 0.5])


def test_turning_is_anticlockwise_about_z() -> None:
    assert rotate(np.array([1.0, 2.0, 3.0]), math.pi / 2) == pytest.approx([-2.0, 1.0, 3.0])
    assert rotate(np.array([[1.0, 0.0, 0.0]] * 2), np.array([0.0, math.pi]))[:, 0] == pytest.approx([1.0, -1.0])


@pytest.mark.parametrize("law", ["paper", "stable"])
@given(data=st.data(), yaw=angles, yaw_rate=st.floats(-2.0, 2.0), seed=seeds)
def test_the_goal_velocity_is_the_derivative_of_the_goal(
    law: str, data: Any, yaw: float, yaw_rate: float, seed: int
) -> None:
    formation = formation_of("rhombus", f"swarm.law={law}")
    rows, rng = all_rows(formation), np.random.default_rng(seed)
    references, velocities = rng.uniform(-3.0, 3.0, (2, 5, 3))
    # Off the corners of the absolute value and of the clamp: same signs of all links, inside or outside.
    size = data.draw(st.sampled_from([0.1, 0.4])) * rng.uniform(0.8, 1.2, (5, 3))
    state = LinkState(displacement=size * rng.choice([-1.0, 1.0], 3), rate=rng.uniform(-1.0, 1.0, (5, 3)))

    def at(t: float) -> Vec:
        moved = LinkState(displacement=state.displacement + state.rate * t, rate=state.rate)
        return solve(rows, references + velocities * t, moved, yaw + yaw_rate * t)

    correction, rate = corrections(rows, state)
    places = place_velocities(rows, correction, rate, yaw, yaw_rate)
    step = 1e-4
    slope = (at(step) - at(-step)) / (2.0 * step)
    assert np.allclose(goal_velocities(rows, velocities, places), slope, atol=1e-6)
