"""A hand that is pointed to: bounded motion, one holder, and the datagrams that carry it."""

import contextlib
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from human_relay.pointing import Limits, PointerState, advance, hear, is_watched, pursue
from shared.clock import NS_PER_S
from shared.errors import DecodeError
from shared.messages import MAX_POSITION, ORIGIN, Wish
from shared.pointer_link import SILENT_S, Pointed, Verb, decode_pointed, encode_pointed

LIMITS = Limits(speed=0.75, acceleration=3.0)
TICK = NS_PER_S // 60
START = 1_000 * NS_PER_S
ONE, OTHER = 11, 22

coordinate = st.floats(-5.0, 5.0)
points = st.tuples(coordinate, coordinate, coordinate)
inside = st.floats(-MAX_POSITION, MAX_POSITION)
datagrams = st.builds(
    Pointed, st.integers(0, 2**64 - 1), st.sampled_from(Verb), st.tuples(inside, inside, inside), inside
)


@given(datagrams)
def test_a_datagram_survives_the_way(pointed: Pointed) -> None:
    assert decode_pointed(encode_pointed(pointed)) == pointed


@given(st.binary(max_size=80) | datagrams.map(encode_pointed))
def test_whatever_arrives_is_decoded_or_refused(datagram: bytes) -> None:
    try:
        pointed = decode_pointed(datagram)
    except DecodeError:
        return
    assert all(abs(number) <= MAX_POSITION for number in (*pointed.position, pointed.yaw))


@given(datagrams, st.integers(0, 43), st.integers(1, 255))
def test_a_flipped_byte_never_raises_anything_else(pointed: Pointed, place: int, flip: int) -> None:
    damaged = bytearray(encode_pointed(pointed))
    damaged[place] ^= flip
    with contextlib.suppress(DecodeError):
        assert decode_pointed(bytes(damaged)) != pointed


@pytest.mark.parametrize(
    ("datagram", "reason"),
    [
        (b"", "malformed"),
        (encode_pointed(Pointed(1, Verb.FLY)) + b"\0", "malformed"),
        (b"XX" + encode_pointed(Pointed(1, Verb.FLY))[2:], "malformed"),
        (b"SP\x02" + encode_pointed(Pointed(1, Verb.FLY))[3:], "version"),
        (b"SP\x01\x09" + encode_pointed(Pointed(1, Verb.FLY))[4:], "out-of-range"),
        (encode_pointed(Pointed(1, Verb.FLY, (math.nan, 0.0, 0.0))), "out-of-range"),
        (encode_pointed(Pointed(1, Verb.FLY, (0.0, 0.0, 1.0), math.inf)), "out-of-range"),
    ],
)
def test_a_wrong_datagram_is_refused_with_its_reason(datagram: bytes, reason: str) -> None:
    with pytest.raises(DecodeError) as refused:
        decode_pointed(datagram)
    assert refused.value.reason == reason


@given(st.lists(st.tuples(points, st.floats(0.001, 0.1)), min_size=1, max_size=60))
def test_a_jumping_pointer_moves_the_hand_within_its_limits(
    jumps: list[tuple[tuple[float, float, float], float]],
) -> None:
    position, velocity = ORIGIN, ORIGIN
    for target, dt in jumps:
        before, was = position, velocity
        position, velocity = pursue(position, velocity, target, dt, LIMITS)
        assert math.hypot(*velocity) <= LIMITS.speed + 1e-9
        assert math.dist(velocity, was) <= LIMITS.acceleration * dt + 1e-9
        assert np.allclose(np.subtract(position, before), np.multiply(velocity, dt))


@given(points)
def test_the_hand_arrives_and_rests(target: tuple[float, float, float]) -> None:
    position, velocity = ORIGIN, ORIGIN
    way = math.hypot(*target)
    for _ in range(round(60 * (way / LIMITS.speed + 2.0))):
        position, velocity = pursue(position, velocity, target, 1 / 60, LIMITS)
        assert math.hypot(*position) <= way + 0.02, "it brakes in time"
    assert position == pytest.approx(target, abs=1e-3)
    assert math.hypot(*velocity) < 1e-2


def held(*steps: tuple[int, Pointed]) -> PointerState:
    state = PointerState()
    for now, pointed in steps:
        state = hear(state, pointed, now)
    return state


def pointing(sender: int, verb: Verb = Verb.FLY, x: float = 1.0) -> Pointed:
    return Pointed(sender, verb, (x, 0.0, 1.2))


def test_the_first_console_keeps_the_hand() -> None:
    state = held((START, pointing(ONE)), (START + 1, pointing(OTHER, x=9.0)))
    assert (state.sender, state.target) == (ONE, (1.0, 0.0, 1.2))
    state = hear(state, Pointed(OTHER, Verb.RELEASED), START + 2)
    assert state.sender == ONE
    state = hear(state, Pointed(ONE, Verb.RELEASED), START + 3)
    assert state.sender is None
    assert hear(state, pointing(OTHER), START + 4).sender == OTHER


def test_a_silent_console_loses_the_hand_to_another() -> None:
    late = START + round(SILENT_S * NS_PER_S) + 1
    state = held((START, pointing(ONE)), (late, pointing(OTHER)))
    assert state.sender == OTHER


def test_a_released_hand_rests_where_it_is_and_is_still_watched() -> None:
    state = advance(held((START, pointing(ONE))), START, LIMITS)
    assert state.position == (1.0, 0.0, 1.2)
    state = hear(state, pointing(ONE, x=3.0), START + TICK)
    for k in range(2, 20):
        state = advance(state, START + k * TICK, LIMITS)
    moving = state.position
    state = hear(state, Pointed(ONE, Verb.RELEASED), START + 20 * TICK)
    state = advance(state, START + 21 * TICK, LIMITS)
    assert moving is not None
    assert state.position == moving
    assert state.velocity == (0.0, 0.0, 0.0)
    assert is_watched(state, START + 25 * TICK)
    assert not is_watched(state, START + 50 * TICK)


def test_it_rests_while_the_operator_holds() -> None:
    state = advance(held((START, pointing(ONE))), START, LIMITS)
    state = advance(hear(state, pointing(ONE, Verb.HOLD, 5.0), START + TICK), START + 2 * TICK, LIMITS)
    assert state.position == (1.0, 0.0, 1.2)
    assert state.wish is Wish.HOLD


def test_stop_counts_from_everybody_and_for_ever() -> None:
    state = held((START, pointing(ONE)), (START + 1, Pointed(OTHER, Verb.STOP)), (START + 2, pointing(ONE)))
    assert state.stopped
    assert state.sender == ONE


def test_a_loop_that_was_held_up_moves_the_hand_no_further() -> None:
    state = advance(held((START, pointing(ONE, x=0.0))), START, LIMITS)
    state = hear(state, pointing(ONE, x=5.0), START + 9 * NS_PER_S)
    state = advance(state, START + 9 * NS_PER_S, LIMITS)
    assert state.position is not None
    assert 0.0 < state.position[0] <= LIMITS.speed * 0.1
