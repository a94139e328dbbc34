"""A hand that jumps rests where it was, and walks to where it is once it moves like a hand again."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from human_relay.guard import PROOF_S, SLACK, WALK, GuardState, guard
from human_relay.sources.base import HandPose
from human_relay.velocity import MAX_SPEED
from shared.clock import NS_PER_S
from shared.messages import Vector, Wish

DT = 1.0 / 60.0
HOME: Vector = (0.0, 0.0, 1.2)
AWAY: Vector = (1.0, 0.5, 1.0)


def poses(*legs: tuple[Vector, float]) -> list[HandPose]:
    """A hand that is at each place for so many seconds, at 60 Hz."""
    places = [place for place, seconds in legs for _ in range(round(seconds / DT))]
    return [
        HandPose(position=place, yaw=0.0, mode=Wish.FLY, t_ns=round(k * DT * NS_PER_S))
        for k, place in enumerate(places)
    ]


def guarded(hand: list[HandPose]) -> list[GuardState]:
    return list(itertools.accumulate(hand, guard, initial=GuardState()))[1:]


def passed(state: GuardState) -> HandPose:
    assert state.passed is not None
    return state.passed


def fastest(states: list[GuardState]) -> float:
    return max(
        math.dist(passed(a).position, passed(b).position) * NS_PER_S / (passed(b).t_ns - passed(a).t_ns)
        for a, b in itertools.pairwise(states)
    )


@pytest.mark.parametrize("speed", [0.0, 0.6, 1.5, 2.9])
def test_a_hand_that_moves_is_passed_on_as_it_is(speed: float) -> None:
    hand = [
        HandPose(
            position=(speed * k * DT, 0.0, 1.0), yaw=0.01 * k, mode=Wish.FLY, t_ns=round(k * DT * NS_PER_S)
        )
        for k in range(120)
    ]
    states = guarded(hand)
    assert [state.passed for state in states] == hand
    assert not any(state.jumped for state in states)
    assert states[-1].jumps == 0


@pytest.mark.parametrize("frames", [1, 5])
def test_a_glitch_rests_and_is_over_when_the_hand_is_back(frames: int) -> None:
    states = guarded(poses((HOME, 0.5), (AWAY, frames * DT), (HOME, 0.5)))
    assert {passed(state).position for state in states} == {HOME}
    assert sum(state.jumped for state in states) == frames
    assert states[-1].jumps == 1


def test_a_hand_that_stays_elsewhere_is_walked_to_and_then_believed() -> None:
    states = guarded(poses((HOME, 0.5), (AWAY, 3.0)))
    assert passed(states[-1]).position == AWAY
    assert not states[-1].jumped
    assert states[-1].jumps == 1
    assert fastest(states) <= WALK + 1e-6
    walking = [state for state in states if state.jumped]
    expected = PROOF_S + math.dist(HOME, AWAY) / WALK
    assert len(walking) * DT == pytest.approx(expected, abs=3 * DT)
    still = [state for state in walking if passed(state).position == HOME]
    assert len(still) * DT >= PROOF_S - DT


def test_a_hand_that_flickers_between_two_places_stays_where_it_was() -> None:
    flicker = [((HOME, AWAY)[k % 2], DT) for k in range(1, 120)]
    states = guarded(poses((HOME, 0.2), *flicker))
    assert {passed(state).position for state in states} == {HOME}


def test_a_hand_that_never_moves_like_one_is_never_believed() -> None:
    wild = [((math.cos(k), math.sin(2.0 * k), 5.0 + k % 3), DT) for k in range(300)]
    states = guarded(poses((HOME, 0.2), *wild))
    assert {passed(state).position for state in states} == {HOME}
    assert states[-1].jumps == 1


def test_a_gap_grants_no_further_way() -> None:
    first, later = poses((HOME, DT))[0], HandPose(position=AWAY, yaw=0.0, mode=Wish.FLY, t_ns=5 * NS_PER_S)
    states = guarded([first, later])
    assert states[-1].jumped
    assert passed(states[-1]).position == HOME


places = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


@given(st.lists(st.tuples(places, st.floats(0.02, 2.0)), min_size=1, max_size=6))
def test_no_hand_moves_what_is_passed_on_by_more_than_a_hand_could(legs: list[tuple[Vector, float]]) -> None:
    states = guarded(poses(*legs, (legs[-1][0], 8.0)))
    for a, b in itertools.pairwise(states):
        assert math.dist(passed(a).position, passed(b).position) <= MAX_SPEED * DT + SLACK + 1e-9
    stamps = [passed(state).t_ns for state in states]
    assert stamps == sorted(set(stamps))
    assert not states[-1].jumped, "it is plausible again in the end"
    assert passed(states[-1]).position == legs[-1][0]
