"""Avoidance: the field of Eqs. 14-16, and the escape that looks ahead."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from agents.control.avoidance import (
    COLUMN_BUBBLE,
    DRONE_BUBBLE,
    HAND_BUBBLE,
    Bubble,
    Encounter,
    Field,
    column_velocity,
    columns_near,
    repulsion,
    separation,
    threats,
)
from agents.control.avoidance import escape as escape_threats
from agents.control.vectors import Planar
from agents.settings import field_of
from shared.scenario import Avoidance

COLUMN = field_of(Avoidance().columns)
DRONE = field_of(Avoidance().separation)
STRAIGHT = Bubble(radius=0.3, lead=0.5)
REST = (0.0, 0.0)

COORDINATE = st.floats(-3.0, 3.0)
POINT = st.tuples(COORDINATE, COORDINATE)
POINTS = st.lists(POINT, min_size=1, max_size=6)
OTHERS = st.lists(st.tuples(POINT, POINT), min_size=1, max_size=5)
ANGLE = st.floats(-math.pi, math.pi)
BUBBLES = st.sampled_from([DRONE_BUBBLE, HAND_BUBBLE, COLUMN_BUBBLE, STRAIGHT])


def resting(*points: Planar) -> list[Encounter]:
    return [Encounter(x, y, 0.0, 0.0) for x, y in points]


def coming(point: Planar, velocity: Planar) -> Encounter:
    return Encounter(*point, *velocity)


def escape(wanted: Planar, point: Planar, velocity: Planar, others: list[Encounter], bubble: Bubble) -> Planar:
    """What is added to `wanted` because of one kind of encounters."""
    return escape_threats(wanted, threats(point, velocity, others, bubble))


def turned(vector: Planar, angle: float) -> Planar:
    (x, y), c, s = vector, math.cos(angle), math.sin(angle)
    return (c * x - s * y, s * x + c * y)


def escaped(other: Planar, moving: Planar, bubble: Bubble) -> Planar:
    """What is added to a point that rests in the origin and wants nothing."""
    return escape(REST, REST, REST, [coming(other, moving)], bubble)


@given(st.floats(0.13, 0.41))
def test_repulsion_is_the_negative_gradient_of_the_potential(distance: float) -> None:
    def potential(x: float) -> float:
        return COLUMN.eta / 2.0 * (1.0 / (x - COLUMN.radius) - 1.0 / COLUMN.d0) ** 2

    assume(distance - COLUMN.radius > 0.021)
    h = 1e-6
    gradient = (potential(distance + h) - potential(distance - h)) / (2 * h)
    u, v = repulsion(distance, 0.0, COLUMN)
    assert u == pytest.approx(-gradient, rel=1e-4, abs=1e-7)
    assert v == 0.0


@pytest.mark.parametrize("field", [COLUMN, DRONE])
@given(gap=POINT | st.tuples(*[st.floats(-0.5, 0.5)] * 2))
def test_repulsion_points_away_is_bounded_and_ends_at_its_range(field: Field, gap: Planar) -> None:
    u, v = repulsion(*gap, field)
    largest = field.eta * (1.0 / 0.02 - 1.0 / field.d0) / 0.02**2
    assert math.hypot(u, v) <= largest * (1 + 1e-12)
    assert math.hypot(*gap) < field.radius + field.d0 + 1e-9 or (u, v) == (0.0, 0.0)
    assert math.hypot(*gap) <= 1e-6 or u * gap[0] + v * gap[1] >= 0.0


def test_column_velocity_is_attraction_plus_repulsion() -> None:
    columns = ((0.3, 0.0),)
    rho = 0.3 - COLUMN.radius
    push = COLUMN.eta * (1 / rho - 1 / COLUMN.d0) / rho**2
    velocity, near = column_velocity((0.0, 0.0), (1.0, 0.0), columns, COLUMN, 2.0)
    assert velocity == pytest.approx((2.0 - push, 0.0))
    assert near
    velocity, near = column_velocity((2.0, 2.0), (2.0, 3.0), columns, COLUMN, 2.0)
    assert velocity == pytest.approx((0.0, 2.0))
    assert not near


def test_separation_of_a_pair_is_equal_and_opposite() -> None:
    one, other = (0.0, 0.0), (0.24, 0.05)
    push, back = separation(*one, resting(other), DRONE), separation(*other, resting(one), DRONE)
    assert push == pytest.approx((-back[0], -back[1]))
    assert push[0] < 0.0


@given(POINTS, POINT, ANGLE, POINT)
def test_separation_does_not_depend_on_place_and_heading(
    others: list[Planar], point: Planar, angle: float, shift: Planar
) -> None:
    def moved(place: Planar) -> Planar:
        x, y = turned(place, angle)
        return (x + shift[0], y + shift[1])

    assume(min(math.dist(point, other) for other in others) > 1e-3)
    push = separation(*point, resting(*others), DRONE)
    again = separation(*moved(point), resting(*map(moved, others)), DRONE)
    assert again == pytest.approx(turned(push, angle), rel=1e-6, abs=1e-6)


@given(OTHERS, BUBBLES, ANGLE)
def test_escape_turns_with_its_world_and_ignores_the_order_of_the_others(
    others: list[tuple[Planar, Planar]], bubble: Bubble, angle: float
) -> None:
    for (x, y), (u, v) in others:
        distance = math.hypot(x, y)
        assume(distance > 1e-2)
        assume(abs(x * v - y * u) > 1e-6)  # exactly on the line of approach the side is a matter of rounding
        assume(
            abs(abs(x * u + y * v) / distance - 0.05) > 1e-6
        )  # and so is standing still exactly at its limit
    push = escape(REST, REST, REST, [coming(*other) for other in others], bubble)
    other_way = [coming(turned(place, angle), turned(moving, angle)) for place, moving in reversed(others)]
    again = escape(REST, REST, REST, other_way, bubble)
    assert again == pytest.approx(turned(push, angle), rel=1e-6, abs=1e-6)


@given(POINT, BUBBLES)
def test_outside_its_bubble_nothing_that_rests_is_escaped_from(other: Planar, bubble: Bubble) -> None:
    assume(math.hypot(*other) > 1e-6)
    u, v = escaped(other, REST, bubble)
    assert (math.hypot(u, v) > 0.0) == (math.hypot(*other) < bubble.radius)
    assert u * other[0] + v * other[1] <= 1e-12


@given(OTHERS, POINT, POINT, BUBBLES)
def test_who_is_let_pass_without_a_root_is_no_threat(
    others: list[tuple[Planar, Planar]], point: Planar, velocity: Planar, bubble: Bubble
) -> None:
    """`threats` leaves most of them out by squares alone; here each is judged by its distance."""
    inside = []
    for place, moving in others:
        gap = np.subtract(point, place)
        distance = float(np.linalg.norm(gap))
        assume(distance > 1e-6)
        closing = max(float(np.subtract(moving, velocity) @ gap) / distance, 0.0)
        depth = bubble.radius + bubble.lead * closing - distance
        assume(abs(depth) > 1e-9)  # where the bubble begins a rounding may decide
        if depth > 0.0:
            inside.append((gap / distance, depth / bubble.response + max(float(gap @ moving) / distance, 0.0)))
    found = threats(point, velocity, [coming(*other) for other in others], bubble)
    assert len(found) == len(inside)
    for threat, (heading, needed) in zip(found, inside, strict=True):
        assert threat.heading == pytest.approx(heading)
        assert threat.needed == pytest.approx(needed)


def test_the_bubble_grows_with_the_closing_speed() -> None:
    far = STRAIGHT.radius + 0.2
    assert not any(escaped((far, 0.0), (0.0, 0.0), STRAIGHT))
    assert not any(escaped((far, 0.0), (1.0, 0.0), STRAIGHT)), "it leaves"
    assert escaped((far, 0.0), (-1.0, 0.0), STRAIGHT)[0] < 0.0, "it comes: 0.5 s ahead is 0.5 m"


def test_in_its_way_one_leaves_at_least_as_fast_as_it_comes() -> None:
    push = escaped((0.3, 0.0), (-0.8, 0.0), STRAIGHT)
    assert push[0] <= -0.8


def test_only_what_is_missing_is_added() -> None:
    others = [coming((0.25, 0.0), (-0.5, 0.0))]
    assert escape((-9.0, 0.0), REST, REST, others, STRAIGHT) == (0.0, 0.0)


@pytest.mark.parametrize(("beside", "side"), [(0.05, 1.0), (-0.05, -1.0), (0.0, -1.0)])
def test_a_slip_leads_aside_of_what_comes(beside: float, side: float) -> None:
    others = [coming((0.4, 0.0), (-1.0, 0.0))]
    push = escape(REST, (0.0, beside), REST, others, Bubble(radius=0.3, lead=0.5, slip=0.5))
    assert push[0] < 0.0
    assert push[1] * side > 0.0


def test_two_that_meet_head_on_pass_on_different_sides() -> None:
    one, other = ((0.0, 0.0), (0.5, 0.0)), ((0.5, 0.0), (-0.5, 0.0))
    push = escape(one[1], *one, [coming(*other)], DRONE_BUBBLE)
    back = escape(other[1], *other, [coming(*one)], DRONE_BUBBLE)
    assert push[1] * back[1] < 0.0


def test_on_top_of_each_other_both_leave_along_x() -> None:
    here = (0.5, -0.5)
    on_top = [coming(here, (0.3, 0.1))]
    assert separation(*here, on_top, DRONE)[0] > 0.0
    (threat,) = threats(here, REST, on_top, DRONE_BUBBLE)
    assert threat.heading == (1.0, 0.0)


@given(OTHERS, BUBBLES)
def test_everything_stays_finite_even_on_top_of_each_other(
    pairs: list[tuple[Planar, Planar]], bubble: Bubble
) -> None:
    others = [coming(*pair) for pair in [*pairs, (REST, REST)]]
    assert all(map(math.isfinite, escape(REST, REST, REST, others, bubble)))
    assert all(map(math.isfinite, separation(*REST, others, DRONE)))


@given(POINT, POINT, POINTS)
def test_columns_near_leaves_out_only_those_that_do_not_matter(
    point: Planar, velocity: Planar, columns: list[Planar]
) -> None:
    near = columns_near(point, velocity, tuple(columns), COLUMN_BUBBLE)
    pushes = [escape(REST, point, velocity, others, COLUMN_BUBBLE) for others in (near, resting(*columns))]
    assert pushes[0] == pytest.approx(pushes[1], abs=1e-9)
