"""Messages and frames on the glove's line, and what noise does to them."""

from typing import Any

import pytest
from cobs import cobs
from hypothesis import given
from hypothesis import strategies as st

from glove_bridge.framing import MAX_PACKET, StreamDecoder, decode, encode
from glove_bridge.patterns.schema import LONGEST_PATTERN_MS, MOST_FRAMES
from glove_bridge.protocol import (
    MAX_FRAMES,
    MAX_PATTERN_MS,
    Ack,
    Hello,
    HelloReply,
    Message,
    Ping,
    Play,
    PlayFrame,
    Set,
    Status,
    Stop,
)
from shared.errors import DecodeError

BYTE = st.integers(0, 0xFF)
WORD = st.integers(0, 0xFFFF)
DUTIES = st.tuples(BYTE, BYTE, BYTE, BYTE, BYTE)
FRAMES = st.lists(
    st.builds(PlayFrame, st.integers(1, MAX_PATTERN_MS // MAX_FRAMES), DUTIES), min_size=1, max_size=MAX_FRAMES
).map(tuple)
MESSAGES: st.SearchStrategy[Message] = st.one_of(
    st.builds(Hello, BYTE, WORD, WORD, BYTE),
    st.builds(Set, BYTE, DUTIES, session=WORD),
    st.builds(Play, BYTE, FRAMES, session=WORD),
    st.builds(Stop, BYTE, session=WORD),
    st.builds(Ping, BYTE, session=WORD),
    st.builds(Ack, BYTE, st.sampled_from(Status), WORD, WORD, session=WORD),
    st.builds(HelloReply, BYTE, BYTE, st.tuples(BYTE, BYTE), WORD, BYTE, BYTE, WORD, WORD),
)


@given(MESSAGES)
def test_what_is_encoded_is_decoded(message: Message) -> None:
    line = encode(message)
    assert line[:1] == line[-1:] == b"\0"
    assert 0 not in line[1:-1]
    assert len(line) <= MAX_PACKET + 3
    assert decode(line[1:-1]) == message


def test_the_bytes_of_a_message_are_these() -> None:
    assert encode(Ping(7, session=0x1234)).hex(" ") == "00 07 05 07 12 34 ae d3 00"
    assert encode(Hello(0, 0x1234, 350)).hex(" ") == "00 02 01 08 02 12 34 01 5e 6a 8c 00"
    assert [len(encode(Play(0, (PlayFrame(200, (9,) * 5),) * n))) for n in (1, 3, 5, 10)] == [16, 30, 44, 79]


def test_every_pattern_of_a_file_fits_with_a_kick_start_in_every_frame() -> None:
    assert MAX_FRAMES >= 2 * MOST_FRAMES
    assert MAX_PATTERN_MS >= LONGEST_PATTERN_MS


@given(st.lists(MESSAGES, max_size=6), st.lists(st.integers(1, 40), min_size=1))
def test_a_stream_may_arrive_in_any_pieces(messages: list[Message], sizes: list[int]) -> None:
    line, decoder, heard = b"".join(map(encode, messages)), StreamDecoder(), []
    while line:
        size = sizes[len(line) % len(sizes)]
        heard += decoder.feed(line[:size])
        line = line[size:]
    assert heard == messages
    assert not decoder.rejected


@given(st.binary(max_size=600), MESSAGES)
def test_garbage_never_costs_the_message_after_it(garbage: bytes, message: Message) -> None:
    decoder = StreamDecoder()
    assert decoder.feed(garbage + encode(message))[-1:] == [message]


def test_one_wrong_byte_is_never_taken_for_another_message() -> None:
    play = Play(9, (PlayFrame(200, (0, 0, 130, 0, 0)), PlayFrame(300, (191, 0, 0, 0, 191))))
    line = encode(play)
    for at in range(1, len(line) - 1):
        for flip in range(1, 256):
            wrong = line[:at] + bytes((line[at] ^ flip,)) + line[at + 1 :]
            assert StreamDecoder().feed(wrong) == []


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (b"\x05ab", "framing"),
        (b"\x02a", "crc"),
        (cobs.encode(b"\x05\x07\x92\x1e"), "crc"),
        (cobs.encode(bytes.fromhex("7f07758f")), "type"),
        (cobs.encode(bytes.fromhex("0300485c")), "body"),
    ],
)
def test_what_is_no_message_is_counted_by_reason(frame: bytes, reason: str) -> None:
    with pytest.raises(DecodeError) as refused:
        decode(frame)
    assert refused.value.reason == reason
    decoder = StreamDecoder()
    assert decoder.feed(frame + b"\0" + encode(Ping(1))) == [Ping(1)]
    assert decoder.rejected == {reason: 1}


def test_a_frame_without_end_is_dropped_in_bounded_memory() -> None:
    decoder = StreamDecoder()
    for _ in range(100):
        assert decoder.feed(b"x" * 1000) == []
    assert len(decoder._frame) <= MAX_PACKET + 2
    assert decoder.feed(b"\0" + encode(Stop(3))) == [Stop(3)]
    assert decoder.rejected == {"oversized": 1}


@pytest.mark.parametrize(
    ("kind", "arguments"),
    [
        (Ping, (256,)),
        (Hello, (0, -1, 350)),
        (Set, (0, (1, 2, 3, 4))),
        (Set, (0, (1, 2, 3, 4, 256))),
        (PlayFrame, (0, (0,) * 5)),
        (Play, (0, ())),
        (Play, (0, (PlayFrame(20, (0,) * 5),) * 33)),
        (Play, (0, (PlayFrame(6000, (0,) * 5),) * 2)),
        (Ack, (0, 77, 0, 0)),
    ],
)
def test_a_message_beyond_its_limits_cannot_be_made(kind: Any, arguments: tuple[Any, ...]) -> None:
    with pytest.raises(ValueError, match=r"must be|frames|ms; at most|not a valid"):
        kind(*arguments)
