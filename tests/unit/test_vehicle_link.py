"""Datagrams between driver and world: exact both ways, and nothing else gets in."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.vehicles.base import Pose
from agents.vehicles.link import MAX_DATAGRAM, Verb, decode_order, decode_pose, encode_order, encode_pose
from shared.errors import DecodeError
from shared.messages import Vector

places = st.tuples(*[st.floats(-1000, 1000)] * 3)
velocities = st.tuples(*[st.floats(-50, 50)] * 3)
drones = st.integers(0, 2**32 - 1)
poses = st.builds(
    Pose,
    position=places,
    velocity=velocities,
    yaw=st.floats(-10, 10),
    battery=st.floats(0, 1),
    airborne=st.booleans(),
    seq=st.integers(0, 2**64 - 1),
)
POSE = Pose((1.0, 2.0, 3.0), (0.1, 0.2, 0.3), 0.5, 1.0, airborne=True, seq=7)


@given(drones, st.sampled_from(Verb), places)
def test_order_survives_the_trip(drone: int, verb: Verb, setpoint: Vector) -> None:
    assert decode_order(encode_order(drone, verb, setpoint)) == (drone, verb, setpoint)


@given(drones, poses)
def test_pose_survives_the_trip(drone: int, pose: Pose) -> None:
    assert decode_pose(encode_pose(drone, pose)) == (drone, pose)


def test_datagrams_fit_the_receive_buffer() -> None:
    assert max(len(encode_order(1, Verb.FLY)), len(encode_pose(1, POSE))) < MAX_DATAGRAM


@given(st.binary(max_size=MAX_DATAGRAM))
def test_garbage_only_raises_decode_errors(datagram: bytes) -> None:
    for decode in (decode_order, decode_pose):
        with pytest.raises(DecodeError):
            decode(datagram)


@given(st.integers(0, 31), st.integers(0, 255))
def test_a_flipped_byte_is_refused_or_in_range(place: int, value: int) -> None:
    datagram = bytearray(encode_order(3, Verb.FLY, (1.0, 2.0, 3.0)))
    datagram[place] = value
    try:
        order = decode_order(bytes(datagram))
    except DecodeError:
        return
    assert all(math.isfinite(c) and abs(c) <= 1000 for c in order.setpoint)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1000.1])
def test_numbers_out_of_range_are_refused(bad: float) -> None:
    with pytest.raises(DecodeError, match="out-of-range"):
        decode_order(encode_order(1, Verb.FLY, (0.0, bad, 0.0)))
    with pytest.raises(DecodeError, match="out-of-range"):
        decode_pose(encode_pose(1, Pose((0.0, 0.0, bad), (0.0, 0.0, 0.0), 0.0, 1.0, airborne=True, seq=0)))
    with pytest.raises(DecodeError, match="out-of-range"):
        decode_pose(encode_pose(1, Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, bad, airborne=True, seq=0)))


def test_other_versions_are_refused_by_name() -> None:
    datagram = bytearray(encode_order(1, Verb.FLY))
    datagram[2] = 2
    with pytest.raises(DecodeError) as caught:
        decode_order(bytes(datagram))
    assert caught.value.reason == "version"
