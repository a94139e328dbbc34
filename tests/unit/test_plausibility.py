"""Plausibility of motion: the limits as properties, and what must not be mistaken for a lie."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.clock import NS_PER_S
from shared.errors import DecodeError
from shared.messages import ORIGIN, Vector
from shared.plausibility import HAND_LIMITS, Believed, MotionLimits, believe, body_limits

LIMITS = MotionLimits(speed=5.0, vertical_speed=10.0, slack=0.5, low=(-4.0, -4.0, -1.0), high=(4.0, 4.0, 4.0))
PERIOD_NS = NS_PER_S // 60

places = st.tuples(*(st.floats(-3.9, 3.9),) * 2, st.floats(-0.9, 3.9))
pauses_ns = st.integers(0, 2 * NS_PER_S)
claims = st.lists(st.tuples(pauses_ns, places), min_size=1, max_size=30)


def reason(known: Believed | None, position: Vector, at_ns: int = 0, velocity: Vector = ORIGIN) -> str | None:
    try:
        believe(known, position, velocity, at_ns, LIMITS)
    except DecodeError as error:
        return error.reason
    return None


@given(claims)
def test_nobody_is_believed_to_have_come_further_than_the_time_allows(claims: list[tuple[int, Vector]]) -> None:
    known, now_ns = None, 0
    way, begin_ns = 0.0, 0
    for pause_ns, place in claims:
        now_ns += pause_ns
        try:
            after = believe(known, place, ORIGIN, now_ns, LIMITS)
        except DecodeError:
            continue
        if known is None:
            begin_ns = now_ns
        else:
            way += math.dist(known.position[:2], after.position[:2])
        known = after
        assert way <= LIMITS.slack + LIMITS.speed * (now_ns - begin_ns) / NS_PER_S + 1e-6


@given(places, places)
def test_a_claim_that_is_kept_up_is_believed_once_the_time_has_passed(one: Vector, other: Vector) -> None:
    known = believe(None, one, ORIGIN, 0, LIMITS)
    needed_s = math.dist(one, other) / LIMITS.speed
    assert reason(known, other, round(needed_s * NS_PER_S)) is None


@given(st.floats(0.0, math.tau), st.floats(0.0, 2.0), st.lists(st.integers(0, 15), min_size=1, max_size=6))
def test_samples_that_are_held_up_and_come_together_are_believed(
    heading: float, speed: float, held: list[int]
) -> None:
    known, tick = None, 0
    for count in held:
        last = tick + count
        for each in range(tick, last + 1):
            way = speed * each / 60.0
            place = (math.cos(heading) * way, math.sin(heading) * way, 1.0)
            if abs(place[0]) < 4.0 and abs(place[1]) < 4.0:
                known = believe(known, place, ORIGIN, last * PERIOD_NS, LIMITS)
        tick = last + 1


def test_what_cannot_be_is_refused_by_its_reason() -> None:
    known = believe(None, (0.0, 0.0, 1.0), ORIGIN, 0, LIMITS)
    assert reason(known, (1.0, 0.0, 1.0), PERIOD_NS) == "jump"
    assert reason(known, (0.0, 0.0, 1.0), PERIOD_NS, (5.1, 0.0, 0.0)) == "too-fast"
    assert reason(None, (4.1, 0.0, 1.0)) == "outside"
    assert reason(None, (math.nan, 0.0, 1.0)) == "outside"
    assert reason(None, (0.0, 0.0, 1.0), 0, (math.nan, 0.0, 0.0)) == "too-fast"


def test_a_falling_body_is_believed() -> None:
    known, height, speed = None, 3.0, 0.0
    for tick in range(40):
        known = believe(known, (0.0, 0.0, height), (0.0, 0.0, -speed), tick * PERIOD_NS, LIMITS)
        height, speed = max(0.0, height - speed / 60.0), speed + 9.81 / 60.0


def test_time_that_runs_backwards_grants_nothing() -> None:
    known = believe(None, (0.0, 0.0, 1.0), ORIGIN, NS_PER_S, LIMITS)
    assert reason(known, (1.0, 0.0, 1.0), 0) == "jump"


def test_the_refusal_says_from_where_to_where() -> None:
    known = believe(None, (0.0, 0.0, 1.0), ORIGIN, 0, LIMITS)
    with pytest.raises(DecodeError, match=r"jump: from \(0.00, 0.00, 1.00\) to \(2.00, 0.00, 1.00\) m"):
        believe(known, (2.0, 0.0, 1.0), ORIGIN, PERIOD_NS, LIMITS)


def test_a_hand_may_be_anywhere_but_not_anywhere_at_once() -> None:
    known = believe(None, (900.0, -900.0, 5.0), (9.0, 0.0, 0.0), 0, HAND_LIMITS)
    reach = believe(known, (900.4, -900.0, 5.0), ORIGIN, PERIOD_NS, HAND_LIMITS)
    with pytest.raises(DecodeError, match="jump"):
        believe(reach, (901.0, -900.0, 5.0), ORIGIN, 2 * PERIOD_NS, HAND_LIMITS)


def test_the_limits_of_a_body_follow_from_fence_and_speeds() -> None:
    slow = body_limits((-1.0, -2.0, 0.0), (1.0, 2.0, 3.0), fastest=0.75)
    assert (slow.low, slow.high) == ((-3.0, -4.0, -2.0), (3.0, 4.0, 5.0))
    assert (slow.speed, slow.vertical_speed) == (5.0, 10.0)
    fast = body_limits((-1.0, -2.0, 0.0), (1.0, 2.0, 3.0), fastest=3.0)
    assert (fast.speed, fast.vertical_speed) == (12.0, 12.0)
