"""The failure ladder as a whole: whatever falls silent, returns or is wished, the drone stays within its limits
and, but for STOP, comes back."""

import itertools
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import settings as hypothesis
from hypothesis import strategies as st

from agents.control.modes import is_airborne
from agents.control.steering import HAND_SPEED_FACTOR, LONGEST_STEP
from agents.control.step import Inputs, Settings, State, start, step
from shared.messages import Flag, Mode, Vector, Wish
from tests.unit.test_step import REST, TICK, drones, hand, inputs, reference, settings, towards
from tests.values import replace

CALM_S, REST_S = 1.0, 12.0
HAND_SPEED = 1.5
CALM_STAMP = 100.0
"""Later than any stamp of the stories, s."""
BODY_SHARE = 0.3
"""How much of the way to its set-point the body covers in one step."""

ages = st.sampled_from([0.0, 0.05, 0.2, 0.4, 0.6, 2.0, 11.0, math.inf])
places = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.0, 2.5))
speeds = st.tuples(*[st.floats(-0.8, 0.8)] * 3)
known = st.none() | st.builds(
    reference,
    places,
    velocity=speeds,
    goal_velocity=speeds,
    mode=st.sampled_from(Mode),
    age=ages,
    fresh=st.booleans(),
)
moments = st.fixed_dictionaries(
    {
        "pose_age": st.sampled_from([0.0, 0.2, 0.6, 3.0]),
        "battery": st.sampled_from([1.0, 1.0, 0.15, 0.05]),
        "hand": st.none()
        | st.builds(hand, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), speeds, st.floats(0.0, 9.0)),
        "wish": st.sampled_from([Wish.FLY, Wish.FLY, Wish.HOLD, Wish.GROUND, Wish.LAND]),
        "hand_age": ages,
        "hand_fresh": st.booleans(),
        "references": st.lists(known, min_size=3, max_size=3),
        "drones": st.lists(places, max_size=3).map(lambda found: drones(*found)),
    }
)
lives = st.lists(st.tuples(moments, st.integers(1, 40)), min_size=1, max_size=8)


class Life:
    """One drone whose body goes part of the way to its set-point in every step."""

    def __init__(self, rules: Settings, *, airborne: bool) -> None:
        self.rules = rules
        self.position: Vector = REST[4] if airborne else (*REST[4][:2], 0.0)
        self.state: State = start(self.position, rules, airborne=airborne)
        self.setpoints: list[tuple[Mode, Vector]] = []
        self.avoiding: list[bool] = []

    def live(self, now: Inputs, seconds: float) -> None:
        for _ in range(max(1, round(seconds / TICK))):
            self.state, output = step(self.state, replace(now, position=self.position), self.rules, TICK)
            mode = self.state.mode.mode
            self.setpoints.append((mode, output.setpoint))
            self.avoiding.append(Flag.AVOIDING in Flag(output.flags))
            goal = output.setpoint if is_airborne(mode) else (*self.position[:2], 0.0)
            self.position = towards(self.position, goal, BODY_SHARE)


def lived(rules: Settings, story: list[tuple[dict[str, Any], int]], *, airborne: bool) -> Life:
    life = Life(rules, airborne=airborne)
    for moment, ticks in story:
        life.live(replace(inputs(4), **moment), ticks * TICK)
    return life


@pytest.mark.parametrize("law", ["paper", "stable"])
@given(story=lives, airborne=st.booleans())
def test_no_sequence_moves_the_set_point_faster_than_the_limits(
    law: str, story: list[tuple[dict[str, Any], int]], airborne: bool
) -> None:
    rules = settings(4, f"swarm.law={law}")
    life = lived(rules, story, airborne=airborne)
    limits, tau = rules.steering, rules.steering.tau
    fastest = max(limits.speed, HAND_SPEED_FACTOR * HAND_SPEED)
    lead = tau * limits.acceleration
    steps = zip(life.setpoints, life.avoiding, strict=True)
    for ((before, a), avoided), ((after, b), avoids) in itertools.pairwise(steps):
        # What the safety filter asks for is bounded by the vehicle's acceleration, not by the mission's speed.
        if is_airborne(before) and is_airborne(after) and not (avoided or avoids):
            assert math.dist(a, b) <= (fastest + lead) * min(TICK, LONGEST_STEP) + 1e-9


@pytest.mark.parametrize("law", ["paper", "stable"])
@hypothesis(max_examples=30)
@given(story=lives, airborne=st.booleans())
def test_every_state_but_stop_is_left_once_all_is_well_and_the_operator_asks(
    law: str, story: list[tuple[dict[str, Any], int]], airborne: bool
) -> None:
    life = lived(settings(4, f"swarm.law={law}"), story, airborne=airborne)
    life.live(inputs(4, wish=Wish.HOLD), CALM_S)
    for k in range(round(REST_S / TICK)):
        # A living hand: it is chased by its own stamps.
        life.live(inputs(4, hand=hand(stamp=CALM_STAMP + k * TICK)), TICK)
    assert life.state.mode.mode is Mode.FOLLOW
    assert all(each.share == 0.0 for each in life.state.stand_ins)
    assert life.setpoints[-1][1] == pytest.approx(REST[4], abs=0.02)


@given(story=lives)
def test_stop_is_never_left(story: list[tuple[dict[str, Any], int]]) -> None:
    life = Life(settings(4), airborne=True)
    life.live(inputs(4, wish=Wish.STOP), TICK)
    for moment, ticks in story:
        life.live(replace(inputs(4), **moment), ticks * TICK)
        assert life.state.mode.mode is Mode.STOP
