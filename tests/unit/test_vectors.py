"""Vectors as tuples against numpy (agents/control/vectors.py)."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.vectors import ORIGIN, Vector, clamp, distance, norm, rotate, shorten

VECTORS = st.tuples(*[st.floats(-2.0, 2.0)] * 3)


@given(VECTORS, VECTORS, st.floats(1e-3, 3.0))
def test_lengths(one: Vector, other: Vector, largest: float) -> None:
    assert norm(one) == pytest.approx(float(np.linalg.norm(one)), rel=1e-12, abs=1e-150)
    assert distance(one, other) == pytest.approx(math.dist(one, other), rel=1e-12, abs=1e-150)
    short = shorten(one, largest)
    assert norm(short) <= largest * (1.0 + 1e-12)
    assert short == one or norm(short) == pytest.approx(largest)
    assert np.cross(short, one) == pytest.approx(ORIGIN, abs=1e-12)


@given(VECTORS)
def test_the_nearest_point_of_a_box(one: Vector) -> None:
    assert clamp(one, (-1.0, -0.5, 0.0), (1.0, 0.5, 0.7)) == tuple(np.clip(one, [-1, -0.5, 0], [1, 0.5, 0.7]))


@given(VECTORS, st.floats(-7.0, 7.0))
def test_turning_is_a_rotation_about_z(one: Vector, yaw: float) -> None:
    c, s = math.cos(yaw), math.sin(yaw)
    assert rotate(one, yaw) == pytest.approx(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ one, abs=1e-12)


def test_turning_is_anticlockwise() -> None:
    assert rotate((1.0, 2.0, 3.0), math.pi / 2) == pytest.approx((-2.0, 1.0, 3.0))
