"""Simulated bodies: step responses, ground, take-off, descent, batching."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from agents.vehicles.bodies.advance import BODIES, SUBSTEP, advance
from agents.vehicles.bodies.airframe import GRAVITY, HOVER_PWM, MASS, thrust_of
from agents.vehicles.bodies.pid import hovering
from agents.vehicles.bodies.state import BodyState, Command, Commands, Vec, at_rest

X, Y, Z = 0, 1, 2
FRAME = 1 / 60


def command(kind: Command, *setpoints: tuple[float, float, float]) -> Commands:
    points = np.array(setpoints or [(0.0, 0.0, 0.0)])
    return Commands(np.full(len(points), kind, dtype=np.int8), points)


def heights(body: str, state: BodyState, kind: Command, seconds: float) -> tuple[Vec, BodyState]:
    track = []
    for _ in range(round(seconds / SUBSTEP)):
        state = BODIES[body](state, command(kind), SUBSTEP)
        track.append(state.position[0, Z])
    return np.array(track), state


def step_response(body: str, axis: int, step: float = 0.5, seconds: float = 30.0) -> tuple[float, float, float]:
    """Returns 10-90 % rise time (s), overshoot (fraction), 5 % settling time (s) of a set-point step."""
    state = hovering(np.array([[0.0, 0.0, 1.0]]))
    target = [0.0, 0.0, 1.0]
    target[axis] += step
    track = []
    for _ in range(round(seconds / SUBSTEP)):
        state = BODIES[body](state, command(Command.FLY, (target[0], target[1], target[2])), SUBSTEP)
        track.append(state.position[0, axis])
    y = 1.0 - (target[axis] - np.array(track)) / step
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
    assert thrust_of(np.array([HOVER_PWM]))[0] == pytest.approx(MASS * GRAVITY, rel=1e-4)
    assert thrust_of(np.zeros(1))[0] == 0.0


@pytest.mark.parametrize("body", BODIES)
def test_thrust_lags_its_command_by_65_ms(body: str) -> None:
    state = advance(BODIES[body], hovering(np.array([[0.0, 0.0, 1.0]])), command(Command.CUT), 0.065)
    assert state.thrust[0] == pytest.approx(MASS * GRAVITY / math.e, rel=1e-3)


def test_identified_body_is_the_fitted_equation() -> None:
    state = hovering(np.array([[0.0, 0.0, 1.0]]))
    track = [0.0]
    for _ in range(1250):
        state = BODIES["identified"](state, command(Command.FLY, (0.2, 0.0, 1.0)), SUBSTEP)
        track.append(state.position[0, X])

    def fitted(_: float, y: Vec) -> list[float]:
        error = 0.2 - y[0]
        return [y[1], 15.64 * error - 8.65 * y[1] + 2.75 * y[2], error]

    times = np.arange(1251) * SUBSTEP
    exact = solve_ivp(fitted, (0.0, 5.0), [0.0, 0.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-12)
    assert np.abs(np.array(track) - exact.y[0]).max() < 1e-3


@pytest.mark.parametrize("body", BODIES)
def test_hover_without_error_stays_put(body: str) -> None:
    start = hovering(np.array([[0.3, -0.2, 1.2]]))
    state = advance(BODIES[body], start, command(Command.FLY, (0.3, -0.2, 1.2)), 5.0)
    assert np.abs(state.position - start.position).max() < 1e-3


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("wait", [0.0, 10.0])
def test_takeoff_along_a_ramp_is_smooth(body: str, wait: float) -> None:
    """The z loop overshoots a step by 44 %; a ramp of 0.5 m/s to 1.2 m must not be wilder than that."""
    state = at_rest(np.zeros((1, 3)))
    track = []
    for frame in range(round((wait + 20.0) / FRAME)):
        height = min(1.2, max(0.0, (frame * FRAME - wait) * 0.5))
        state = advance(BODIES[body], state, command(Command.FLY, (0.0, 0.0, height)), FRAME)
        track.append((height, state.position[0, Z], state.velocity[0, Z]))
    wanted, height_reached, climb = np.array(track).T
    assert height_reached.max() < 1.2 + 0.35
    assert np.abs(climb).max() < 0.8
    assert np.abs(height_reached - wanted).max() < 0.35
    assert abs(height_reached[-1] - 1.2) < 0.03


@pytest.mark.parametrize("body", BODIES)
def test_nothing_winds_up_or_slides_on_the_ground(body: str) -> None:
    state = at_rest(np.zeros((1, 3)))
    state = advance(BODIES[body], state, command(Command.FLY, (3.0, -3.0, 0.0)), 10.0)
    assert state.position.tolist() == [[0.0, 0.0, 0.0]]
    assert state.integral[0, :2].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("body", BODIES)
def test_cut_body_falls_and_comes_to_rest(body: str) -> None:
    track, state = heights(body, hovering(np.array([[0.0, 0.0, 2.0]])), Command.CUT, 3.0)
    fall = (np.argmax(track <= 0.0) + 1) * SUBSTEP
    assert math.sqrt(2 * 2.0 / GRAVITY) < fall < math.sqrt(2 * 2.0 / GRAVITY) + 0.15
    assert all(after <= before for before, after in pairwise(track))
    assert state.grounded.all()
    assert not state.velocity.any()


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("kind", [Command.DESCEND, Command.IDLE])
def test_open_loop_descent_lands_gently(body: str, kind: Command) -> None:
    track, state = heights(body, hovering(np.array([[0.0, 0.0, 1.45]])), kind, 6.0)
    speeds = -np.diff(track) / SUBSTEP
    assert state.grounded.all()
    assert 2.0 < np.argmax(track <= 0.0) * SUBSTEP < 4.0
    assert speeds.max() < 1.2


@pytest.mark.parametrize("body", BODIES)
def test_idle_on_the_ground_is_motors_off(body: str) -> None:
    state = advance(BODIES[body], at_rest(np.zeros((1, 3))), command(Command.IDLE), 1.0)
    assert state.output[0, Z] == 0.0
    assert state.thrust[0] == 0.0


@pytest.mark.parametrize("body", BODIES)
def test_level_keeps_thrust_and_coasts(body: str) -> None:
    state = hovering(np.array([[0.0, 0.0, 1.2]]))
    state = state._replace(velocity=np.array([[0.5, 0.0, 0.0]]))
    state = advance(BODIES[body], state, command(Command.LEVEL), 1.5)
    assert state.output[0].tolist() == [0.0, 0.0, HOVER_PWM]
    assert state.position[0, X] == pytest.approx(0.5 * 1.5, rel=0.1)
    assert state.position[0, Z] == pytest.approx(1.2, abs=0.02)


@pytest.mark.parametrize("body", BODIES)
def test_return_from_level_does_not_kick(body: str) -> None:
    state = hovering(np.array([[0.0, 0.0, 1.2]]))
    state = advance(BODIES[body], state, command(Command.LEVEL), 1.0)
    state = BODIES[body](state, command(Command.FLY, (0.02, 0.0, 1.2)), SUBSTEP)
    assert abs(state.output[0, X]) <= 1.0


@pytest.mark.parametrize("body", BODIES)
def test_a_batch_is_the_same_as_each_alone(body: str) -> None:
    rng = np.random.default_rng(1)
    places = rng.uniform((-2, -2, 0), (2, 2, 4), (7, 3))
    commands = Commands(rng.integers(0, 5, 7).astype(np.int8), rng.uniform(-2, 2, (7, 3)))
    together = advance(BODIES[body], hovering(places), commands, 2.0)
    for row in range(7):
        own = Commands(commands.kind[row : row + 1], commands.setpoint[row : row + 1])
        alone = advance(BODIES[body], hovering(places[row : row + 1]), own, 2.0)
        assert alone.position[0].tolist() == together.position[row].tolist()


@pytest.mark.parametrize("body", BODIES)
def test_the_cut_into_durations_does_not_matter(body: str) -> None:
    target = command(Command.FLY, (0.4, -0.1, 1.3))
    whole = advance(BODIES[body], hovering(np.array([[0.0, 0.0, 1.0]])), target, 2.0)
    pieces = hovering(np.array([[0.0, 0.0, 1.0]]))
    for _ in range(120):
        pieces = advance(BODIES[body], pieces, target, FRAME)
    assert np.abs(whole.position - pieces.position).max() < 2e-3


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
def test_no_command_sequence_breaks_physics(
    body: str, script: list[tuple[Command, tuple[float, float, float], float]]
) -> None:
    state = at_rest(np.zeros((1, 3)))
    for kind, setpoint, duration in script:
        state = advance(BODIES[body], state, command(kind, setpoint), duration)
        assert np.isfinite(state.position).all()
        assert state.position[0, Z] >= 0.0
        assert np.abs(state.velocity).max() < 30.0
