"""The messages as a vocabulary: frozen values, one topic each, words that agree."""

from inspect import Parameter, signature

import pytest

from shared.codec import decode, encode
from shared.errors import DecodeError, SwarmTouchError
from shared.messages import NO_HAND, ORIGIN, Flag, HandSample, Message, Mode, Wish
from shared.topics import TOPICS

KINDS = Message.__subclasses__()


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_a_message_is_a_frozen_value_with_the_envelope_first(kind: type[Message]) -> None:
    assert kind.__struct_fields__[:3] == ("epoch", "seq", "stamp_ns")
    assert all(each.kind is Parameter.KEYWORD_ONLY for each in signature(kind).parameters.values())
    assert kind.__hash__ is not object.__hash__
    assert kind.__setattr__ is not object.__setattr__


def test_each_message_has_one_topic() -> None:
    assert sorted(topic.kind.__name__ for topic in TOPICS) == sorted(kind.__name__ for kind in KINDS)


def test_a_sample_cannot_be_changed() -> None:
    sample = HandSample(epoch=1, seq=0, stamp_ns=1, position=ORIGIN, velocity=ORIGIN, yaw=0.0, mode=Wish.HOLD)
    with pytest.raises(AttributeError, match="immutable"):
        sample.seq = 1  # type: ignore[misc]


def test_a_hand_that_is_not_there_can_be_sent() -> None:
    sample = HandSample(epoch=1, seq=0, stamp_ns=1, position=NO_HAND, velocity=ORIGIN, yaw=0.0, mode=Wish.HOLD)
    assert decode(encode(sample), HandSample).position == NO_HAND


def test_all_flags_but_one_are_flags() -> None:
    others = ~Flag.FENCE
    assert Flag.FENCE not in others
    assert list(others | Flag.FENCE) == list(Flag)


def test_flags_are_distinct_bits_of_32() -> None:
    bits = [int(flag) for flag in Flag]
    assert all(bit.bit_count() == 1 for bit in bits)
    assert len(set(bits)) == len(bits)
    assert sum(bits) < 2**32


def test_every_wish_but_fly_is_also_a_mode() -> None:
    assert {wish.value for wish in Wish} - {mode.value for mode in Mode} == {"FLY"}


def test_a_decode_error_carries_its_reason() -> None:
    error = DecodeError("wrong-type", "a number is expected")
    assert isinstance(error, SwarmTouchError)
    assert (error.reason, str(error)) == ("wrong-type", "wrong-type: a number is expected")
    assert str(DecodeError("oversized")) == "oversized"
