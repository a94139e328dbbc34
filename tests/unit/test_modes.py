"""Flight modes: the rows of DESIGN section 5 one by one, and that no mode but STOP is a trap."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.modes import MISSED_HOLD, MISSED_LAND, ModeInputs, ModeState, initial_mode, next_mode
from shared.messages import Mode, Wish
from tests.values import fields, replace

NEVER = math.inf
TAKEOFF_HEIGHT = 1.2
CALM = ModeInputs(
    wish=Wish.FLY,
    hand_age=0.0,
    pose_age=0.0,
    battery=1.0,
    height=TAKEOFF_HEIGHT,
    takeoff_height=TAKEOFF_HEIGHT,
    missed_for=0.0,
    references_follow=True,
    awaiting=False,
    alone=False,
)
"""In the air with everything as it should be."""
DOWN = replace(CALM, height=0.0)
AIRBORNE = [Mode.TAKEOFF, Mode.FOLLOW, Mode.HOLD, Mode.LAND]


def after(mode: Mode, **changes: Any) -> Mode:
    """The mode one step later, in the air unless said otherwise."""
    return next_mode(ModeState(mode=mode), replace(CALM, **changes)).mode


def test_a_whole_flight() -> None:
    state = initial_mode(airborne=False)
    seen = []
    for inputs in (
        replace(DOWN, wish=None, hand_age=NEVER),
        replace(DOWN, wish=Wish.GROUND),
        DOWN,
        replace(CALM, height=0.6),
        CALM,
        replace(CALM, wish=Wish.HOLD),
        CALM,
        replace(CALM, wish=Wish.LAND),
        replace(CALM, wish=Wish.LAND, height=0.6),
        replace(DOWN, wish=Wish.LAND),
        replace(DOWN, wish=Wish.LAND),
        DOWN,
    ):
        state = next_mode(state, inputs)
        seen.append(state.mode)
    assert seen == [
        Mode.GROUND,
        Mode.GROUND,
        Mode.TAKEOFF,
        Mode.TAKEOFF,
        Mode.FOLLOW,
        Mode.HOLD,
        Mode.FOLLOW,
        Mode.LAND,
        Mode.LAND,
        Mode.GROUND,
        Mode.GROUND,
        Mode.TAKEOFF,
    ]


@pytest.mark.parametrize(
    ("airborne", "mode"), [(True, Mode.HOLD), (False, Mode.GROUND)], ids=["airborne", "on the ground"]
)
def test_a_restarted_process_reads_its_pose_first(airborne: bool, mode: Mode) -> None:
    assert fields(initial_mode(airborne=airborne)) == fields(ModeState(mode=mode))


@pytest.mark.parametrize(
    "missing",
    [
        {"pose_age": 0.11},
        {"pose_age": NEVER},
        {"hand_age": 0.26},
        {"hand_age": NEVER, "wish": None},
        {"wish": Wish.HOLD},
        {"wish": Wish.LAND},
        {"wish": Wish.GROUND},
        {"awaiting": True},
        {"alone": True},
        {"missed_for": 0.01},
    ],
    ids=str,
)
def test_take_off_is_refused_without_pose_hand_wish_and_company(missing: dict[str, Any]) -> None:
    assert after(Mode.GROUND, height=0.0) is Mode.TAKEOFF
    assert after(Mode.GROUND, height=0.0, **missing) is Mode.GROUND


def test_a_drone_takes_off_before_its_references_and_waits_for_them_at_height() -> None:
    alone = {"references_follow": False}
    assert after(Mode.GROUND, height=0.0, **alone) is Mode.TAKEOFF
    assert after(Mode.TAKEOFF, height=1.09, **alone) is Mode.TAKEOFF
    assert after(Mode.TAKEOFF, height=1.11, **alone) is Mode.HOLD
    assert after(Mode.TAKEOFF, height=1.11) is Mode.FOLLOW


@pytest.mark.parametrize(
    ("mode", "age", "then"),
    [
        (Mode.FOLLOW, 0.26, Mode.FOLLOW),
        (Mode.FOLLOW, 0.99, Mode.FOLLOW),
        (Mode.FOLLOW, 1.01, Mode.HOLD),
        (Mode.FOLLOW, 10.01, Mode.LAND),
        (Mode.HOLD, 0.24, Mode.FOLLOW),
        (Mode.HOLD, 0.26, Mode.HOLD),
        (Mode.HOLD, 9.99, Mode.HOLD),
        (Mode.HOLD, 10.01, Mode.LAND),
        (Mode.TAKEOFF, 0.99, Mode.HOLD),
        (Mode.TAKEOFF, 10.01, Mode.LAND),
        (Mode.LAND, 10.01, Mode.LAND),
        (Mode.GROUND, 10.01, Mode.GROUND),
    ],
)
def test_a_silent_hand_means_hold_then_land(mode: Mode, age: float, then: Mode) -> None:
    assert after(mode, hand_age=age) is then


@pytest.mark.parametrize("mode", [Mode.TAKEOFF, Mode.FOLLOW, Mode.HOLD])
def test_whom_others_miss_holds_then_lands(mode: Mode) -> None:
    climbing = {"height": 0.6} if mode is Mode.TAKEOFF else {}
    assert after(mode, missed_for=MISSED_HOLD, **climbing) is (mode if climbing else Mode.FOLLOW)
    assert after(mode, missed_for=MISSED_HOLD + 0.01, **climbing) is (mode if climbing else Mode.HOLD)
    assert after(mode, missed_for=MISSED_LAND + 0.01, **climbing) is Mode.LAND
    unheard = {"missed_for": MISSED_LAND + 0.01, "hand_age": NEVER, "wish": None}
    assert after(mode, **unheard, **climbing) is Mode.LAND


def test_a_drone_that_awaits_others_holds_and_one_that_is_alone_flies_on() -> None:
    for mode in (Mode.FOLLOW, Mode.HOLD, Mode.TAKEOFF):
        assert after(mode, awaiting=True) is Mode.HOLD
        assert after(mode, alone=True) is Mode.FOLLOW


def test_a_restarted_drone_that_has_never_heard_a_hand_holds() -> None:
    assert after(Mode.HOLD, wish=None, hand_age=NEVER) is Mode.HOLD


@pytest.mark.parametrize("mode", [Mode.FOLLOW, Mode.TAKEOFF, Mode.HOLD])
def test_the_follower_of_a_drone_that_does_not_follow_holds(mode: Mode) -> None:
    assert after(mode, references_follow=False) is Mode.HOLD
    assert after(mode, references_follow=False) is Mode.HOLD
    assert after(mode) is Mode.FOLLOW


@pytest.mark.parametrize("wish", [Wish.GROUND, Wish.LAND])
@pytest.mark.parametrize("mode", AIRBORNE)
def test_land_and_ground_in_flight_mean_land(mode: Mode, wish: Wish) -> None:
    assert after(mode, wish=wish) is Mode.LAND
    assert after(mode, wish=wish, references_follow=False) is Mode.LAND


@pytest.mark.parametrize("wish", [Wish.FLY, Wish.HOLD, None])
def test_a_landing_goes_on_to_the_ground_whatever_is_wished(wish: Wish | None) -> None:
    assert after(Mode.LAND, wish=wish) is Mode.LAND
    assert after(Mode.LAND, wish=wish, height=0.07) is Mode.LAND
    assert after(Mode.LAND, wish=wish, height=0.05) is Mode.GROUND


@pytest.mark.parametrize("mode", Mode)
def test_stop_is_reached_from_every_mode_however_old_it_is(mode: Mode) -> None:
    assert after(mode, wish=Wish.STOP) is Mode.STOP
    assert after(mode, wish=Wish.STOP, hand_age=20.0, pose_age=NEVER) is Mode.STOP


wishes = st.none() | st.sampled_from(Wish)
ages = st.sampled_from([0.0, 0.2, 0.3, 0.9, 1.1, 9.0, 11.0, NEVER]) | st.floats(0.0, 20.0)
any_inputs = st.builds(
    ModeInputs,
    wish=wishes,
    hand_age=ages,
    pose_age=ages,
    battery=st.sampled_from([0.05, 0.15, 1.0]) | st.floats(0.0, 1.0),
    height=st.sampled_from([0.0, 0.05, 0.07, 1.0, 1.15]) | st.floats(-1.0, 3.0),
    takeoff_height=st.just(TAKEOFF_HEIGHT),
    missed_for=st.just(0.0) | ages.filter(math.isfinite),
    references_follow=st.booleans(),
    awaiting=st.booleans(),
    alone=st.booleans(),
)


@given(inputs=any_inputs, asked=st.booleans())
def test_stop_is_latched(inputs: ModeInputs, asked: bool) -> None:
    assert next_mode(ModeState(mode=Mode.STOP, must_ask_again=asked), inputs).mode is Mode.STOP


@pytest.mark.parametrize("mode", [Mode.TAKEOFF, Mode.FOLLOW, Mode.HOLD])
@pytest.mark.parametrize("asking", [Wish.GROUND, Wish.LAND, Wish.HOLD])
def test_after_a_landing_that_nobody_wished_the_operator_has_to_ask_again(mode: Mode, asking: Wish) -> None:
    state = next_mode(ModeState(mode=mode), replace(CALM, hand_age=10.5))
    assert fields(state) == fields(ModeState(mode=Mode.LAND, must_ask_again=True))
    for inputs in (CALM, DOWN, DOWN, DOWN):
        state = next_mode(state, inputs)
    assert fields(state) == fields(ModeState(mode=Mode.GROUND, must_ask_again=True))
    stale = next_mode(state, replace(DOWN, wish=asking, hand_age=0.3))
    assert next_mode(stale, DOWN).mode is Mode.GROUND
    asked = next_mode(state, replace(DOWN, wish=asking))
    assert fields(asked) == fields(ModeState(mode=Mode.GROUND))
    assert next_mode(asked, DOWN).mode is Mode.TAKEOFF


@pytest.mark.parametrize("wish", [Wish.GROUND, Wish.LAND])
def test_after_a_landing_on_wish_to_fly_is_asking_again(wish: Wish) -> None:
    state = next_mode(ModeState(mode=Mode.FOLLOW), replace(CALM, wish=wish))
    for inputs in (replace(DOWN, wish=wish), DOWN):
        state = next_mode(state, inputs)
    assert state.mode is Mode.TAKEOFF


def test_a_wish_to_land_that_is_older_than_the_patience_is_nobodys_wish() -> None:
    state = next_mode(ModeState(mode=Mode.HOLD), replace(CALM, wish=Wish.LAND, hand_age=10.5))
    assert fields(state) == fields(ModeState(mode=Mode.LAND, must_ask_again=True))


def reached(history: list[ModeInputs], *, airborne: bool) -> ModeState:
    state = initial_mode(airborne=airborne)
    for inputs in history:
        state = next_mode(state, inputs)
    return state


@given(history=st.lists(any_inputs, max_size=30), airborne=st.booleans())
def test_from_wherever_it_is_the_operator_brings_it_down_and_up_again(
    history: list[ModeInputs], airborne: bool
) -> None:
    state = reached([i for i in history if i.wish is not Wish.STOP], airborne=airborne)
    assert state.mode is not Mode.STOP
    for inputs in (replace(CALM, wish=Wish.LAND), replace(DOWN, wish=Wish.LAND)):
        state = next_mode(state, inputs)
    assert fields(state) == fields(ModeState(mode=Mode.GROUND))
    for inputs, mode in ((DOWN, Mode.TAKEOFF), (CALM, Mode.FOLLOW)):
        state = next_mode(state, inputs)
        assert state.mode is mode


@given(history=st.lists(any_inputs, max_size=30), airborne=st.booleans())
def test_only_stop_and_touchdown_end_a_flight(history: list[ModeInputs], airborne: bool) -> None:
    state = initial_mode(airborne=airborne)
    for inputs in history:
        before, state = state, next_mode(state, inputs)
        if state.mode is Mode.STOP:
            assert inputs.wish is Wish.STOP or before.mode is Mode.STOP
        elif state.mode is Mode.GROUND:
            assert before.mode in (Mode.GROUND, Mode.LAND)
        elif before.mode is Mode.GROUND:
            assert (state.mode, inputs.wish, before.must_ask_again) == (Mode.TAKEOFF, Wish.FLY, False)
