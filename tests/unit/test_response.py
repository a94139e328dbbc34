"""How a vehicle answers: the model against bodies that are so, and the point ahead against the theorem."""

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.safety.response import Axis, Response, asked_by, observe, setpoint_for, start_axis, tell

TICK = 1.0 / 60.0
RESPONSES = st.builds(
    Response,
    stiffness=st.floats(0.5, 20.0),
    damping=st.floats(0.0, 10.0),
    feed=st.floats(0.0, 5.0),
    lag=st.just(0.0) | st.floats(0.01, 0.3),
    acceleration=st.floats(1.0, 6.0),
)
SMALL = st.floats(-2.0, 2.0)


@given(RESPONSES, SMALL, SMALL, SMALL, SMALL, st.floats(-1.0, 1.0))
def test_a_setpoint_asks_for_what_it_was_made_for(
    response: Response, position: float, velocity: float, rest: float, before: float, share: float
) -> None:
    axis = Axis(position, velocity, 0.0, rest, before, 0.0)
    wanted = share * response.acceleration
    assert asked_by(setpoint_for(wanted, axis, TICK, response), axis, TICK, response) == pytest.approx(wanted)


class Body:
    """One axis of a body that is exactly as the model says, but for a force that nobody knows."""

    def __init__(self, response: Response, force: float) -> None:
        self.response, self.force = response, force
        self.position = self.velocity = self.actual = 0.0

    def advance(self, setpoint: float, rate: float, dt: float) -> None:
        steps = 20
        for _ in range(steps):
            asked = self.response.asks(setpoint - self.position, rate, self.velocity, self.force)
            lag, h = self.response.lag, dt / steps
            self.actual = asked if lag == 0.0 else asked + (self.actual - asked) * math.exp(-h / lag)
            self.position += self.velocity * h + 0.5 * self.actual * h * h
            self.velocity += self.actual * h


@given(RESPONSES, st.floats(-0.4, 0.4), st.integers(0, 2**16))
def test_what_the_model_leaves_over_is_found_within_a_second(
    response: Response, force: float, seed: int
) -> None:
    draw = random.Random(seed)
    body, axis = Body(response, force), start_axis(0.0, 0.0)
    for _ in range(180):
        wanted = draw.uniform(-0.4, 0.4)
        setpoint = setpoint_for(wanted, axis, TICK, response)
        axis = tell(setpoint, axis, TICK)
        body.advance(setpoint, axis.rate, TICK)
        axis = observe(axis, body.position, body.velocity, TICK, response)
    assert axis.rest == pytest.approx(force, abs=0.1)


@given(RESPONSES, st.lists(st.floats(-1.0, 1.0), min_size=10, max_size=60), st.floats(-0.2, 0.2))
def test_the_point_ahead_obeys_at_once_and_the_body_stays_behind_it(
    response: Response, wanted: list[float], force: float
) -> None:
    """A wall that the point ahead never passes is never passed by the body."""
    body, axis = Body(response, force), start_axis(0.0, 0.0)
    axis = Axis(0.0, 0.0, 0.0, force, 0.0, 0.0)
    farthest = 0.0
    for share in wanted:
        for _ in range(6):
            asked = share * 0.7 * response.acceleration
            before = axis.velocity + response.lag * axis.actual
            setpoint = setpoint_for(asked, axis, TICK, response)
            axis = tell(setpoint, axis, TICK)
            body.advance(setpoint, axis.rate, TICK)
            axis = observe(axis, body.position, body.velocity, TICK, response)
            pace = axis.velocity + response.lag * axis.actual
            assert pace - before == pytest.approx(asked * TICK, abs=0.35 * response.acceleration * TICK)
            farthest = max(farthest, axis.position + response.lag * axis.velocity)
            assert body.position <= farthest + 1e-3


def test_two_poses_at_the_same_time_say_nothing() -> None:
    response = Response(stiffness=5.0, damping=2.0, feed=0.0, lag=0.1, acceleration=3.0)
    axis = start_axis(0.0, 0.0)
    assert observe(axis, 5.0, 5.0, 0.0, response) is axis


def test_what_is_thought_of_a_body_that_is_held_does_not_outlast_that() -> None:
    """Held for 4 s while it is told to go, then let go: it is known again soon after it flies."""
    response = Response(stiffness=6.85, damping=3.47, feed=3.42, lag=0.177, acceleration=1.73)
    body, axis = Body(response, 0.0), start_axis(0.0, 0.0)
    for tick in range(285):
        axis = tell(1.5, axis, TICK)
        if tick >= 240:
            body.advance(1.5, axis.rate, TICK)
        axis = observe(axis, body.position, body.velocity, TICK, response)
    assert abs(axis.rest) < 0.5
