"""Simulated bodies: step responses, ground, take-off, descent."""

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from agents.control.vectors import ORIGIN, Vector
from agents.vehicles.bodies.airframe import GRAVITY, HOVER_PWM, MASS, thrust_of
from agents.vehicles.bodies.fleet import BODIES, SUBSTEP, Flyer, advance
from agents.vehicles.bodies.pid import hovering
from agents.vehicles.bodies.state import Body, Command, at_rest

Vec = npt.NDArray[np.float64]

X, Y, Z = 0, 1, 2
FRAME = 1 / 60


def flown(body: str, state: Body, kind: Command, seconds: float, setpoint: Vector = ORIGIN) -> Body:
    """The body after some time with one command."""
    return advance(Flyer(state, BODIES[body]), kind.value, setpoint, seconds).body


def track(body: str, state: Body, kind: Command, seconds: float, setpoint: Vector = ORIGIN) -> list[Body]:
    """The same after every substep."""
    states = []
    for _ in range(round(seconds / SUBSTEP)):
        state = flown(body, state, kind, SUBSTEP, setpoint)
        states.append(state)
    return states


def step_response(body: str, axis: int, step: float = 0.5, seconds: float = 30.0) -> tuple[float, float, float]:
    """Returns 10-90 % rise time (s), overshoot (fraction), 5 % settling time (s) of a set-point step."""
    target = [0.0, 0.0, 1.0]
    target[axis] += step
    states = track(body, hovering((0.0, 0.0, 1.0)), Command.FLY, seconds, (target[0], target[1], target[2]))
    y = 1.0 - (target[axis] - np.array([state.position[axis] for state in states])) / step
    rise = (np.argmax(y >= 0.9) - np.argmax(y >= 0.1)) * SUBSTEP
    settle = np.flatnonzero(np.abs(y - 1.0) > 0.05)[-1] * SUBSTEP
    return float(rise), float(y.max() - 1.0), float(settle)


@pytest.mark.parametrize("axis", [X, Y])
def test_crazyflie_horizontal_step_meets_the_quoted_response(axis: int) -> None:
    rise, overshoot, settle = step_response("crazyflie", axis)
    assert rise == pytest.approx(0.61, rel=0.10)
    assert overshoot == pytest.approx(0.17, rel=0.10)
    assert settle == pytest.approx(2.3, rel=0.10)


@pytest.mark.parametrize("body", BODIES)
def test_vertical_step_meets_the_quoted_response(body: str) -> None:
    _, overshoot, settle = step_response(body, Z)
    assert overshoot == pytest.approx(0.44, rel=0.10)
    assert settle == pytest.approx(8.7, rel=0.10)


def test_hover_command_carries_the_weight() -> None:
    assert thrust_of(HOVER_PWM) == pytest.approx(MASS * GRAVITY, rel=1e-4)
    assert thrust_of(0.0) == 0.0


@pytest.mark.parametrize("body", BODIES)
def test_thrust_lags_its_command_by_65_ms(body: str) -> None:
    state = flown(body, hovering((0.0, 0.0, 1.0)), Command.CUT, 0.065)
    assert state.thrust == pytest.approx(MASS * GRAVITY / math.e, rel=1e-3)


def test_identified_body_is_the_fitted_equation() -> None:
    states = track("identified", hovering((0.0, 0.0, 1.0)), Command.FLY, 5.0, (0.2, 0.0, 1.0))

    def fitted(_: float, y: Vec) -> list[float]:
        error = 0.2 - y[0]
        return [y[1], 15.64 * error - 8.65 * y[1] + 2.75 * y[2], error]

    times = np.arange(1251) * SUBSTEP
    exact = solve_ivp(fitted, (0.0, 5.0), [0.0, 0.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-12)
    assert np.abs(np.array([0.0, *(state.position[X] for state in states)]) - exact.y[0]).max() < 1e-3


@pytest.mark.parametrize("body", BODIES)
def test_hover_without_error_stays_put(body: str) -> None:
    here = (0.3, -0.2, 1.2)
    assert math.dist(flown(body, hovering(here), Command.FLY, 5.0, here).position, here) < 1e-3


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("wait", [0.0, 10.0])
def test_takeoff_along_a_ramp_is_smooth(body: str, wait: float) -> None:
    """The z loop overshoots a step by 44 %; a ramp of 0.5 m/s to 1.2 m must not be wilder than that."""
    state = at_rest(ORIGIN)
    heights = []
    for frame in range(round((wait + 20.0) / FRAME)):
        height = min(1.2, max(0.0, (frame * FRAME - wait) * 0.5))
        state = flown(body, state, Command.FLY, FRAME, (0.0, 0.0, height))
        heights.append((height, state.position[Z], state.velocity[Z]))
    wanted, reached, climb = np.array(heights).T
    assert reached.max() < 1.2 + 0.35
    assert np.abs(climb).max() < 0.8
    assert np.abs(reached - wanted).max() < 0.35
    assert abs(reached[-1] - 1.2) < 0.03


@pytest.mark.parametrize("body", BODIES)
def test_nothing_winds_up_or_slides_on_the_ground(body: str) -> None:
    state = flown(body, at_rest(ORIGIN), Command.FLY, 10.0, (3.0, -3.0, 0.0))
    assert state.position == ORIGIN
    assert state.integral[:2] == (0.0, 0.0)


@pytest.mark.parametrize("body", BODIES)
def test_cut_body_falls_and_comes_to_rest(body: str) -> None:
    states = track(body, hovering((0.0, 0.0, 2.0)), Command.CUT, 3.0)
    heights = [state.position[Z] for state in states]
    fall = (heights.index(0.0) + 1) * SUBSTEP
    assert math.sqrt(2 * 2.0 / GRAVITY) < fall < math.sqrt(2 * 2.0 / GRAVITY) + 0.15
    assert all(after <= before for before, after in pairwise(heights))
    assert states[-1].position[Z] == 0.0
    assert states[-1].velocity == ORIGIN


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("kind", [Command.DESCEND, Command.IDLE])
def test_open_loop_descent_lands_gently(body: str, kind: Command) -> None:
    heights = [state.position[Z] for state in track(body, hovering((0.0, 0.0, 1.45)), kind, 6.0)]
    assert heights[-1] == 0.0
    assert 2.0 < heights.index(0.0) * SUBSTEP < 4.0
    assert -np.diff(heights).min() / SUBSTEP < 1.2


@pytest.mark.parametrize("body", BODIES)
def test_idle_on_the_ground_is_motors_off(body: str) -> None:
    state = flown(body, at_rest(ORIGIN), Command.IDLE, 1.0)
    assert state.output[Z] == 0.0
    assert state.thrust == 0.0


@pytest.mark.parametrize("body", BODIES)
def test_level_keeps_thrust_and_coasts(body: str) -> None:
    coasting = hovering((0.0, 0.0, 1.2)).moved((0.0, 0.0, 1.2), (0.5, 0.0, 0.0))
    state = flown(body, coasting, Command.LEVEL, 1.5)
    assert state.output == (0.0, 0.0, HOVER_PWM)
    assert state.position[X] == pytest.approx(0.5 * 1.5, rel=0.1)
    assert state.position[Z] == pytest.approx(1.2, abs=0.02)


@pytest.mark.parametrize("body", BODIES)
def test_return_from_level_does_not_kick(body: str) -> None:
    state = flown(body, hovering((0.0, 0.0, 1.2)), Command.LEVEL, 1.0)
    state = flown(body, state, Command.FLY, SUBSTEP, (0.02, 0.0, 1.2))
    assert abs(state.output[X]) <= 1.0


@pytest.mark.parametrize("body", BODIES)
def test_the_cut_into_durations_does_not_matter(body: str) -> None:
    target = (0.4, -0.1, 1.3)
    whole = flown(body, hovering((0.0, 0.0, 1.0)), Command.FLY, 2.0, target)
    pieces = hovering((0.0, 0.0, 1.0))
    for _ in range(120):
        pieces = flown(body, pieces, Command.FLY, FRAME, target)
    assert whole.position == pytest.approx(pieces.position, abs=2e-3)


@pytest.mark.parametrize("body", BODIES)
@settings(max_examples=25, deadline=None)
@given(
    script=st.lists(
        st.tuples(
            st.sampled_from(Command),
            st.tuples(*(st.floats(-1000, 1000) for _ in range(3))),
            st.floats(0.0, 0.5),
        ),
        max_size=8,
    )
)
def test_no_command_sequence_breaks_physics(body: str, script: list[tuple[Command, Vector, float]]) -> None:
    state = at_rest(ORIGIN)
    for kind, setpoint, duration in script:
        state = flown(body, state, kind, duration, setpoint)
        assert all(map(math.isfinite, state.position))
        assert state.position[Z] >= 0.0
        assert max(map(abs, state.velocity)) < 30.0
