"""The link step against a matrix exponential, in every damping regime."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from agents.control.impedance import AT_REST, LinkState, Spring, discretise, step_links
from agents.settings import drone_row
from shared.config import load_scenario
from shared.formation import build_formation

PAPER = (1.9, 12.6, 21.0, -7.0)

masses = st.floats(0.01, 100.0)
dampings = st.floats(0.0, 100.0)
stiffnesses = st.floats(0.01, 100.0)
steps = st.floats(1e-5, 5.0)


def matrices(link: tuple[float, float, float, float], dt: float) -> np.ndarray:
    """[Ad Bd] of our step, 2 x 3."""
    a00, a01, a10, a11, b0, b1 = discretise(*link, dt)
    return np.array([[a00, a01, b0], [a10, a11, b1]])


def exponential(link: tuple[float, float, float, float], dt: float) -> np.ndarray:
    """[Ad Bd] as the exponential of the augmented matrix."""
    mass, damping, stiffness, gain = link
    augmented = np.array([[0, 1, 0], [-stiffness / mass, -damping / mass, gain / mass], [0, 0, 0]])
    return np.asarray(expm(augmented * dt))[:2]


def relative_error(ours: np.ndarray, truth: np.ndarray) -> float:
    return float(np.linalg.norm(ours - truth) / np.linalg.norm(truth))


def random_link(rng: np.random.Generator, regime: str) -> tuple[float, float, float, float]:
    mass, damping, stiffness = 10.0 ** rng.uniform(-2.0, 2.0, 3)
    critical = 2.0 * math.sqrt(mass * stiffness)
    damping = {
        "any": damping,
        "undamped": 0.0,
        "critical": critical,
        "nearly critical": critical * (1.0 + 10.0 ** rng.uniform(-14, -3) * rng.choice([-1, 1])),
        "strongly overdamped": critical * 10.0 ** rng.uniform(1, 3),
    }[regime]
    return mass, damping, stiffness, rng.uniform(-10.0, 10.0)


@pytest.mark.parametrize("regime", ["any", "undamped", "critical", "nearly critical", "strongly overdamped"])
def test_the_step_is_the_matrix_exponential(regime: str) -> None:
    rng = np.random.default_rng(sum(map(ord, regime)))
    for _ in range(1000):
        link, dt = random_link(rng, regime), float(10.0 ** rng.uniform(-5.0, math.log10(5.0)))
        error = relative_error(matrices(link, dt), exponential(link, dt))
        assert error < 1e-10, (link, dt, error)


@pytest.mark.parametrize("dt", [1e-5, 1e-4, 1e-3, 1.0 / 60.0, 0.1, 5.0])
def test_the_papers_link_at_any_step(dt: float) -> None:
    assert relative_error(matrices(PAPER, dt), exponential(PAPER, dt)) < 1e-12


def test_the_printed_signs_of_the_paper_would_explode() -> None:
    mass, damping, stiffness, _ = PAPER
    a, b = -damping / mass, -stiffness / mass
    as_printed = np.asarray(expm(np.array([[0, 1], [-b, -a]]) / 60.0))
    assert max(abs(np.linalg.eigvals(as_printed))) > 1.1
    assert max(abs(np.linalg.eigvals(matrices(PAPER, 1.0 / 60.0)[:, :2]))) < 1.0


@given(masses, dampings, stiffnesses, st.floats(1e-4, 2.0))
def test_two_half_steps_are_one_step(mass: float, damping: float, stiffness: float, dt: float) -> None:
    link = (mass, damping, stiffness, 3.0)
    half, whole = matrices(link, dt / 2.0), matrices(link, dt)
    twice = np.column_stack([half[:, :2] @ half[:, :2], half[:, :2] @ half[:, 2] + half[:, 2]])
    assert relative_error(twice, whole) < 1e-9


@given(masses, st.floats(0.1, 100.0), stiffnesses)
def test_a_held_velocity_displaces_by_gain_over_stiffness(
    mass: float, damping: float, stiffness: float
) -> None:
    slowest = max(mass / damping, damping / stiffness)
    forever = discretise(mass, damping, stiffness, -7.0, 1e3 * slowest)
    assert forever[4] == pytest.approx(-7.0 / stiffness, rel=1e-6)
    assert abs(forever[0]) < 1e-6


@given(st.floats(1e-6, 1e6), st.floats(0.0, 1e6), st.floats(1e-6, 1e6), st.floats(1e-9, 1e4))
def test_no_parameters_overflow(mass: float, damping: float, stiffness: float, dt: float) -> None:
    assert np.isfinite(discretise(mass, damping, stiffness, -7.0, dt)).all()


@given(st.lists(steps, min_size=1, max_size=5))
def test_links_step_axis_by_axis_like_one_matrix(times: list[float]) -> None:
    scenario = load_scenario("rhombus")
    links = drone_row(scenario, build_formation(scenario), 4).links
    states: tuple[LinkState, ...] = (AT_REST, AT_REST)
    one = np.zeros((2, 3))
    velocity = (0.4, -0.2, 0.1)
    for dt in times:
        states = step_links(states, links, velocity, dt)
        ad_bd = matrices(PAPER, dt)
        one = ad_bd[:, :2] @ one + np.outer(ad_bd[:, 2], velocity)
    for state in states:
        assert state.displacement == pytest.approx(one[0])
        assert state.rate == pytest.approx(one[1])


@given(st.lists(st.sampled_from([1 / 60, 1 / 120, 0.02]), min_size=1, max_size=8))
def test_a_spring_remembers_only_what_is_still_true(times: list[float]) -> None:
    spring = Spring(*PAPER)
    assert [spring.over(dt) for dt in times] == [discretise(*PAPER, dt) for dt in times]


def test_links_with_their_own_parameters_move_differently() -> None:
    scenario = load_scenario("rhombus", ['impedance.links=[{name="2-4", stiffness=84.0}]'])
    links = drone_row(scenario, build_formation(scenario), 4).links
    states: tuple[LinkState, ...] = (AT_REST, AT_REST)
    for _ in range(600):
        states = step_links(states, links, (0.3, 0.0, 0.0), 1 / 60)
    by_name = {link.name: state.displacement[0] for link, state in zip(links, states, strict=True)}
    assert by_name["2-4"] == pytest.approx(by_name["3-4"] / 4.0)
