"""Avoidance: the field of Eqs. 14-16, and the escape that looks ahead."""

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from agents.control.avoidance import (
    COLUMN_BUBBLE,
    DRONE_BUBBLE,
    HAND_BUBBLE,
    Bubble,
    Encounters,
    column_velocity,
    columns_near,
    repulsion,
    separation,
    threats,
)
from agents.control.avoidance import escape as escape_threats
from shared.scenario import Avoidance, FieldSettings

Vec = npt.NDArray[np.float64]

COLUMN = Avoidance().columns
DRONE = Avoidance().separation
STRAIGHT = Bubble(radius=0.3, lead=0.5)

COORDINATE = st.floats(-3.0, 3.0)
POINT = st.tuples(COORDINATE, COORDINATE)
POINTS = st.lists(POINT, min_size=1, max_size=6)
ANGLE = st.floats(-math.pi, math.pi)
BUBBLES = st.sampled_from([DRONE_BUBBLE, HAND_BUBBLE, COLUMN_BUBBLE, STRAIGHT])


def one_row(
    positions: list[tuple[float, float]], velocities: list[tuple[float, float]] | None = None
) -> Encounters:
    others = np.array(positions, dtype=float).reshape(-1, 2)
    moving = np.zeros_like(others) if velocities is None else np.array(velocities, dtype=float).reshape(-1, 2)
    return Encounters(row=np.zeros(len(others), dtype=np.intp), position=others, velocity=moving)


def escape(wanted: Vec, points: Vec, velocities: Vec, others: Encounters, bubble: Bubble) -> Vec:
    """What is added to `wanted` because of one kind of encounters."""
    return escape_threats(wanted, threats(points, velocities, others, bubble))


def turned(vectors: Vec, angle: float) -> Vec:
    c, s = math.cos(angle), math.sin(angle)
    result: Vec = vectors @ np.array([[c, s], [-s, c]])
    return result


def escaped(other: tuple[float, float], moving: tuple[float, float], bubble: Bubble) -> Vec:
    """What is added to a point that rests in the origin and wants nothing."""
    rest = np.zeros((1, 2))
    push: Vec = escape(rest, rest, rest, one_row([other], [moving]), bubble)[0]
    return push


@given(st.floats(0.13, 0.41))
def test_repulsion_is_the_negative_gradient_of_the_potential(distance: float) -> None:
    def potential(x: float) -> float:
        return COLUMN.eta / 2.0 * (1.0 / (x - COLUMN.radius) - 1.0 / COLUMN.d0) ** 2

    assume(distance - COLUMN.radius > 0.021)
    h = 1e-6
    gradient = (potential(distance + h) - potential(distance - h)) / (2 * h)
    velocity = repulsion(np.array([[distance, 0.0]]), COLUMN)[0]
    assert velocity[0] == pytest.approx(-gradient, rel=1e-4, abs=1e-7)
    assert velocity[1] == 0.0


@given(POINTS, st.sampled_from([COLUMN, DRONE]))
def test_repulsion_points_away_is_bounded_and_ends_at_its_range(
    gaps: list[tuple[float, float]], settings: FieldSettings
) -> None:
    vectors = np.array(gaps)
    velocity = repulsion(vectors, settings)
    distance = np.linalg.norm(vectors, axis=1)
    largest = settings.eta * (1.0 / 0.02 - 1.0 / settings.d0) / 0.02**2
    assert (np.linalg.norm(velocity, axis=1) <= largest * (1 + 1e-12)).all()
    assert (velocity[distance >= settings.radius + settings.d0] == 0.0).all()
    assert (np.sum(velocity * vectors, axis=1)[distance > 1e-6] >= 0.0).all()


def test_column_velocity_is_attraction_plus_repulsion() -> None:
    points, goals = np.array([[0.0, 0.0], [2.0, 2.0]]), np.array([[1.0, 0.0], [2.0, 3.0]])
    columns = np.array([[0.3, 0.0]])
    velocity, near = column_velocity(points, goals, columns, COLUMN, 2.0)
    rho = 0.3 - COLUMN.radius
    push = COLUMN.eta * (1 / rho - 1 / COLUMN.d0) / rho**2
    assert velocity == pytest.approx(np.array([[2.0 - push, 0.0], [0.0, 2.0]]))
    assert near.tolist() == [[True], [False]]


def test_separation_of_a_pair_is_equal_and_opposite() -> None:
    points = np.array([[0.0, 0.0], [0.24, 0.05]])
    others = Encounters(row=np.array([0, 1]), position=points[::-1].copy(), velocity=np.zeros((2, 2)))
    push = separation(points, others, DRONE)
    assert push[0] == pytest.approx(-push[1])
    assert push[0, 0] < 0.0


@given(POINTS, POINT, ANGLE, POINT)
def test_separation_does_not_depend_on_place_and_heading(
    others: list[tuple[float, float]], point: tuple[float, float], angle: float, shift: tuple[float, float]
) -> None:
    here, around = np.array([point]), np.array(others)
    assume(np.linalg.norm(here - around, axis=1).min() > 1e-3)
    push = separation(here, one_row(others), DRONE)
    moved = one_row([tuple(p) for p in turned(around, angle) + shift])
    again = separation(turned(here, angle) + shift, moved, DRONE)
    assert again == pytest.approx(turned(push, angle), rel=1e-6, abs=1e-6)


@given(st.lists(st.tuples(POINT, POINT), min_size=1, max_size=5), BUBBLES, ANGLE)
def test_escape_turns_with_its_world_and_ignores_the_order_of_the_others(
    pairs: list[tuple[tuple[float, float], tuple[float, float]]], bubble: Bubble, angle: float
) -> None:
    positions, velocities = np.array([p for p, _ in pairs]), np.array([v for _, v in pairs])
    assume(np.linalg.norm(positions, axis=1).min() > 1e-2)
    across = positions[:, 0] * velocities[:, 1] - positions[:, 1] * velocities[:, 0]
    assume(np.abs(across).min() > 1e-6)  # exactly on the line of approach the side is a matter of rounding
    speed_along = np.abs(np.sum(positions * velocities, axis=1)) / np.linalg.norm(positions, axis=1)
    assume(np.abs(speed_along - 0.05).min() > 1e-6)  # and so is standing still exactly at its limit
    rest, order = np.zeros((1, 2)), np.random.default_rng(len(pairs)).permutation(len(pairs))
    row = np.zeros(len(pairs), dtype=np.intp)
    push = escape(rest, rest, rest, Encounters(row=row, position=positions, velocity=velocities), bubble)
    other_way = Encounters(
        row=row, position=turned(positions, angle)[order], velocity=turned(velocities, angle)[order]
    )
    assert escape(rest, rest, rest, other_way, bubble) == pytest.approx(turned(push, angle), rel=1e-6, abs=1e-6)


@given(POINT, BUBBLES)
def test_outside_its_bubble_nothing_that_rests_is_escaped_from(
    other: tuple[float, float], bubble: Bubble
) -> None:
    assume(math.hypot(*other) > 1e-6)
    inside = math.hypot(*other) < bubble.radius
    push = escaped(other, (0.0, 0.0), bubble)
    assert (np.linalg.norm(push) > 0.0) == inside
    assert push @ np.array(other) <= 1e-12


def test_the_bubble_grows_with_the_closing_speed() -> None:
    far = STRAIGHT.radius + 0.2
    assert not escaped((far, 0.0), (0.0, 0.0), STRAIGHT).any()
    assert not escaped((far, 0.0), (1.0, 0.0), STRAIGHT).any(), "it leaves"
    assert escaped((far, 0.0), (-1.0, 0.0), STRAIGHT)[0] < 0.0, "it comes: 0.5 s ahead is 0.5 m"


def test_in_its_way_one_leaves_at_least_as_fast_as_it_comes() -> None:
    push = escaped((0.3, 0.0), (-0.8, 0.0), STRAIGHT)
    assert push[0] <= -0.8


def test_only_what_is_missing_is_added() -> None:
    rest, wanted = np.zeros((1, 2)), np.array([[-9.0, 0.0]])
    others = one_row([(0.25, 0.0)], [(-0.5, 0.0)])
    assert not escape(wanted, rest, rest, others, STRAIGHT).any()


@pytest.mark.parametrize(("beside", "side"), [(0.05, 1.0), (-0.05, -1.0), (0.0, -1.0)])
def test_a_slip_leads_aside_of_what_comes(beside: float, side: float) -> None:
    rest = np.zeros((1, 2))
    point = np.array([[0.0, beside]])
    coming = one_row([(0.4, 0.0)], [(-1.0, 0.0)])
    push = escape(rest, point, rest, coming, Bubble(radius=0.3, lead=0.5, slip=0.5))[0]
    assert push[0] < 0.0
    assert push[1] * side > 0.0


def test_two_that_meet_head_on_pass_on_different_sides() -> None:
    points, velocities = np.array([[0.0, 0.0], [0.5, 0.0]]), np.array([[0.5, 0.0], [-0.5, 0.0]])
    others = Encounters(row=np.array([0, 1]), position=points[::-1].copy(), velocity=velocities[::-1].copy())
    push = escape(velocities, points, velocities, others, DRONE_BUBBLE)
    assert push[0, 1] * push[1, 1] < 0.0


@given(POINTS, POINTS, BUBBLES)
def test_everything_stays_finite_even_on_top_of_each_other(
    positions: list[tuple[float, float]], velocities: list[tuple[float, float]], bubble: Bubble
) -> None:
    n = min(len(positions), len(velocities))
    others = one_row([*positions[:n], (0.0, 0.0)], [*velocities[:n], (0.0, 0.0)])
    rest = np.zeros((1, 2))
    assert np.isfinite(escape(rest, rest, rest, others, bubble)).all()
    assert np.isfinite(separation(rest, others, DRONE)).all()


@given(POINTS, POINT, POINTS)
def test_a_batch_is_its_rows(
    points: list[tuple[float, float]], wanted: tuple[float, float], others: list[tuple[float, float]]
) -> None:
    own = np.array(points)
    wish, still = np.tile(wanted, (len(own), 1)), np.zeros_like(own)
    row = np.repeat(np.arange(len(own)), len(others))
    flat = np.tile(np.array(others), (len(own), 1))
    together = escape(
        wish, own, still, Encounters(row=row, position=flat, velocity=np.zeros_like(flat)), DRONE_BUBBLE
    )
    alone = [
        escape(wish[:1], own[k : k + 1], still[:1], one_row(others), DRONE_BUBBLE)[0] for k in range(len(own))
    ]
    assert together == pytest.approx(np.array(alone), abs=1e-9)


@given(POINTS, POINT, POINTS)
def test_columns_near_leaves_out_only_those_that_do_not_matter(
    points: list[tuple[float, float]], velocity: tuple[float, float], columns: list[tuple[float, float]]
) -> None:
    own = np.array(points)
    moving, still = np.tile(velocity, (len(own), 1)), np.zeros_like(own)
    near = columns_near(own, moving, np.array(columns), COLUMN_BUBBLE)
    row = np.repeat(np.arange(len(own)), len(columns))
    flat = np.tile(np.array(columns), (len(own), 1))
    every = Encounters(row=row, position=flat, velocity=np.zeros_like(flat))
    pushes = [escape(still, own, moving, others, COLUMN_BUBBLE) for others in (near, every)]
    assert pushes[0] == pytest.approx(pushes[1], abs=1e-9)
