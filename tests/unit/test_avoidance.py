"""Avoidance of the mission: the field of Eqs. 14-16."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from agents.control.avoidance import Field, column_velocity, repulsion, separation
from agents.control.safety.encounter import Encounter
from agents.control.vectors import ORIGIN, Planar
from agents.settings import field_of
from shared.scenario import Avoidance

COLUMN = field_of(Avoidance().columns)
DRONE = field_of(Avoidance().separation)

COORDINATE = st.floats(-3.0, 3.0)
POINT = st.tuples(COORDINATE, COORDINATE)
POINTS = st.lists(POINT, min_size=1, max_size=6)
ANGLE = st.floats(-math.pi, math.pi)


def resting(*points: Planar) -> list[Encounter]:
    return [Encounter((x, y, 0.0), ORIGIN, 0.3) for x, y in points]


def turned(vector: Planar, angle: float) -> Planar:
    (x, y), c, s = vector, math.cos(angle), math.sin(angle)
    return (c * x - s * y, s * x + c * y)


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
