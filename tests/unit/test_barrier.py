"""Barriers: who obeys them brakes in time, and they never demand more than the braking they are made for."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.safety.barrier import Curve

CURVES = st.builds(Curve, st.floats(0.5, 5.0), st.floats(1.0, 8.0))
GAPS = st.floats(-0.5, 3.0)
SPEEDS = st.floats(-3.0, 3.0)
TICK = 1.0 / 60.0


@given(CURVES, st.lists(GAPS, min_size=2, max_size=2, unique=True))
def test_the_wider_the_gap_the_faster_it_may_close(curve: Curve, gaps: list[float]) -> None:
    near, far = sorted(gaps)
    assert curve.pace(near) <= curve.pace(far)
    assert curve.pace(0.0) == 0.0


@given(CURVES, GAPS)
def test_the_curve_has_no_kink(curve: Curve, gap: float) -> None:
    h = 1e-5
    slope = (curve.pace(gap + h) - curve.pace(gap - h)) / (2 * h)
    assert -1e-6 <= slope <= curve.rate * (1 + 1e-4)


@given(CURVES, st.floats(0.0, 3.0))
def test_along_the_curve_no_more_is_demanded_than_its_braking(curve: Curve, gap: float) -> None:
    assert curve.demand(gap, curve.pace(gap)) <= curve.brake * (1 + 1e-9)


@given(CURVES, st.floats(-2.0, 4.0))
def test_the_gap_for_a_speed_is_the_curve_the_other_way_round(curve: Curve, closing: float) -> None:
    assert curve.pace(curve.gap_for(closing)) == pytest.approx(closing, abs=1e-9)


@given(CURVES, st.floats(0.0, 2.0), SPEEDS, st.floats(0.0, 6.0))
def test_whoever_obeys_brakes_in_time(curve: Curve, gap: float, closing: float, push: float) -> None:
    """Something pushes inwards as hard as it can; only what is demanded holds against it."""
    closing = min(closing, curve.pace(gap))
    nearest = gap
    for _ in range(600):
        opening = max(curve.demand(gap, closing), -push)
        gap -= closing * TICK - 0.5 * opening * TICK * TICK
        closing -= opening * TICK
        nearest = min(nearest, gap)
    # What a control step of a 60th of a second adds to continuous time.
    assert nearest >= -0.5 * curve.brake * TICK * TICK * (1 + curve.rate)
    assert gap >= -1e-3


@given(CURVES, st.floats(-0.5, -0.01))
def test_what_is_too_near_leaves_within_a_few_time_constants(curve: Curve, gap: float) -> None:
    closing = 0.0
    for _ in range(round(10.0 / curve.rate / TICK)):
        opening = curve.demand(gap, closing)
        gap -= closing * TICK - 0.5 * opening * TICK * TICK
        closing -= opening * TICK
    assert gap >= -0.01
