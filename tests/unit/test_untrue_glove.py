"""A device that does not tell the truth, and a port that is no glove: patterns end, the line stays quiet."""

from collections.abc import Callable
from typing import Any

import attrs
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glove_bridge.framing import StreamDecoder, encode
from glove_bridge.gloves.base import CUT_SHORT, Report
from glove_bridge.link_timing import USB
from glove_bridge.plausible import CLOCK, LATE_MS
from glove_bridge.protocol import (
    HELD,
    PROTOCOL,
    Ack,
    Command,
    Hello,
    HelloReply,
    Ping,
    Play,
    PlayFrame,
    Reply,
    Status,
)
from glove_bridge.session import ATTEMPTS, NOT_A_GLOVE, UNANSWERED, Session
from tests.simulated_glove import MS, Device

STRONG = (0, 0, 200, 0, 0)
PATTERN = (PlayFrame(200, STRONG), PlayFrame(100, STRONG))
LENGTH_MS = 300
LONGEST_MS = LENGTH_MS * (1 + CLOCK) + LATE_MS + 300
"""A pattern has ended by then, whatever a device says: the rest is for one more PING and its repetitions."""
MOST_LINES_PER_S = 220
"""PINGs every 5 ms at most, while a pattern is almost over; a line takes more."""

Answer = Callable[[Command, int], bytes]


class Line:
    """A host, and whatever answers it; one millisecond at a time."""

    def __init__(self, answer: Answer) -> None:
        self.session, self.now_ns, self.lines = Session(USB, nonce=7), 0, 0
        self.reports: list[Report] = []
        self._answer, self._decoder = answer, StreamDecoder()
        self.session.opened(0)

    def run(self, ms: int) -> None:
        for _ in range(ms):
            for message in self._decoder.feed(self.session.due(self.now_ns)):
                assert not isinstance(message, Ack | HelloReply)
                self.lines += 1
                self.session.receive(self._answer(message, self.now_ns), self.now_ns)
            self.reports += self.session.take_reports()
            self.now_ns += MS

    def play(self) -> list[str]:
        """Plays a pattern and returns what became of it, which is known in time."""
        self.reports.clear()
        self.session.play(PATTERN, self.now_ns)
        self.run(round(LONGEST_MS))
        return [report.outcome.value for report in self.reports]


def bent(**lies: Any) -> Answer:
    """A device that works, and says something else."""
    device = Device()

    def answer(command: Command, now_ns: int) -> bytes:
        device.tick(now_ns)
        reply: Reply = device.answer(command, now_ns)
        known = {field.name for field in attrs.fields(type(reply))}
        return encode(attrs.evolve(reply, **{name: lie for name, lie in lies.items() if name in known}))

    return answer


@pytest.mark.parametrize(
    ("lies", "why"),
    [
        ({"remaining_ms": 60_000}, "something plays that nobody asked for"),
        ({"remaining_ms": HELD}, "something plays that nobody asked for"),
        ({"status": Status.UNKNOWN_TYPE}, "it refuses PING: UNKNOWN_TYPE"),
        ({"status": Status.NO_SESSION}, "the device was reset"),
        ({"session": 99}, "what it says is no answer to P"),
        ({"motors": 3}, "it says that it has 3 motors, a glove has 5"),
        ({"max_frames": 0}, "it takes patterns of up to 0 frames and 10000 ms"),
        ({"max_pattern_ms": 9_999}, "it takes patterns of up to 32 frames and 9999 ms"),
        ({"deadman_ms": 0}, "it grants a dead-man of 0 ms where 350 were asked for"),
        ({"deadman_ms": 60_000}, "it grants a dead-man of 60000 ms"),
    ],
)
def test_a_device_that_says_what_cannot_be_is_no_glove_and_says_why(lies: dict[str, Any], why: str) -> None:
    line = Line(bent(**lies))
    line.run(1_000)
    assert why in line.session.fault
    assert line.play() == ["failed"]
    assert why in line.reports[-1].why
    assert why in line.session.fault
    assert line.lines < MOST_LINES_PER_S


def lying_while_it_plays(remaining_ms: int) -> Answer:
    """Answers well until there is something to play."""
    device, playing = Device(), False

    def answer(command: Command, now_ns: int) -> bytes:
        nonlocal playing
        playing = isinstance(command, Play) or (playing and isinstance(command, Ping))
        reply = device.answer(command, now_ns)
        return encode(
            attrs.evolve(reply, remaining_ms=remaining_ms) if playing and isinstance(reply, Ack) else reply
        )

    return answer


@pytest.mark.parametrize(
    ("remaining_ms", "outcomes", "why"),
    [
        (60_000, ["failed"], "60000 ms remain of 300"),
        (HELD, ["failed"], "65535 ms remain of 300"),
        (301, ["failed"], "301 ms remain of 300"),
        (300, ["started", "failed"], "a pattern of 300 ms still plays"),
        (0, ["failed"], "0 ms remain 0 ms after 300 were asked for"),
    ],
)
def test_a_pattern_ends_in_time_and_the_glove_is_unusable_until_one_is_played_well(
    remaining_ms: int, outcomes: list[str], why: str
) -> None:
    line = Line(lying_while_it_plays(remaining_ms))
    line.run(50)
    assert line.session.fault == ""
    assert line.play() == outcomes
    assert why in line.reports[-1].why
    line.run(500)
    assert line.session.device is not None, "greeted anew"
    assert why in line.session.fault
    assert line.session.rejected["untrue"] == 1
    line._answer = bent()
    line.run(500)
    assert why in line.session.fault, "that it answers is not enough"
    assert line.play() == ["started", "finished"]
    assert line.session.fault == ""


@pytest.mark.parametrize("off", [-0.08, 0.08])
def test_a_clock_that_is_off_a_little_is_believed(off: float) -> None:
    device = Device()
    line = Line(lambda command, now_ns: encode(device.answer(command, round(now_ns * (1 + off)))))
    line.run(50)
    assert line.play() == ["started", "finished"]


replies = st.one_of(
    st.builds(
        Ack, st.just(0), st.sampled_from(Status), st.sampled_from([0, 1, 150, 299, 300, HELD]), st.just(0)
    ),
    st.builds(
        HelloReply,
        seq=st.just(0),
        protocol=st.sampled_from([PROTOCOL, PROTOCOL + 1]),
        firmware=st.just((9, 9)),
        nonce=st.just(0),
        motors=st.sampled_from([5, 0]),
        max_frames=st.sampled_from([32, 0]),
        max_pattern_ms=st.sampled_from([10_000, 0]),
        deadman_ms=st.sampled_from([350, 100, 0, 0xFFFF]),
    ),
)


@given(st.lists(st.tuples(replies, st.booleans(), st.booleans()), min_size=1, max_size=12))
def test_whatever_a_device_answers_patterns_end_once_and_the_line_stays_quiet(
    script: list[tuple[Reply, bool, bool]],
) -> None:
    """The script is repeated for ever; an answer is to the right command or not, or does not come."""
    count = 0

    def answer(command: Command, _: int) -> bytes:
        nonlocal count
        reply, fits, comes = script[count % len(script)]
        count += 1
        if fits and isinstance(reply, Ack) and not isinstance(command, Hello):
            reply = attrs.evolve(reply, seq=command.seq, session=command.session)
        elif fits and isinstance(reply, HelloReply) and isinstance(command, Hello):
            reply = attrs.evolve(reply, seq=command.seq, nonce=command.nonce)
        return encode(reply) if comes else b""

    line = Line(answer)
    for _ in range(3):
        line.run(150)
        outcomes = line.play()
        assert outcomes[-1:] in (["finished"], ["failed"]), outcomes
        assert outcomes[:-1] in ([], ["started"])
    assert line.lines / (line.now_ns / 1e9) < MOST_LINES_PER_S


@pytest.mark.parametrize(
    "said",
    [
        pytest.param(
            lambda _: b"$GPGGA,092750.000,5321.6802,N,00630.3372,W,1,8,1.03*76\r\n", id="a GPS receiver"
        ),
        pytest.param(lambda _: b"\xe0\x00\xfe\x80\x1c" * 10, id="another rate"),
        pytest.param(encode, id="an echo"),
    ],
)
def test_a_port_that_talks_and_is_no_glove_says_so(said: Callable[[Command], bytes]) -> None:
    line = Line(lambda command, _: said(command))
    line.run(90)
    assert line.session.fault == UNANSWERED
    line.run(500)
    assert line.session.fault == NOT_A_GLOVE
    line._answer = bent()
    line.run(300)
    assert line.session.fault == "", "it is one after all"


def test_a_silent_port_and_a_board_that_stutters_at_its_start_are_not_accused() -> None:
    for chatter in (b"", b"\x14\x10\x00"):
        line = Line(lambda _, now_ns, said=chatter: said if now_ns == 0 else b"")  # type: ignore[misc]
        line.run(2_000)
        assert line.session.fault == UNANSWERED


def test_another_version_is_named_whatever_nonce_it_answers_with() -> None:
    """A real chip that opens no session repeats its own nonce, not the greeting's."""
    line = Line(bent(protocol=PROTOCOL - 1, nonce=0))
    line.run(500)
    assert f"speaks protocol {PROTOCOL - 1}, not {PROTOCOL}; flash it" in line.session.fault


def refusing(status: Status) -> Answer:
    """A device that works, and plays nothing."""
    device = Device()

    def answer(command: Command, now_ns: int) -> bytes:
        reply = device.answer(command, now_ns)
        return encode(
            attrs.evolve(reply, status=status)
            if isinstance(reply, Ack) and isinstance(command, Play)
            else reply
        )

    return answer


def test_why_a_pattern_has_failed_is_reported() -> None:
    line = Line(refusing(Status.BAD_BODY))
    line.run(100)
    assert line.play() == ["failed"]
    assert line.reports[-1].why == "it refuses PLAY: BAD_BODY"

    silent = bent()
    line = Line(lambda command, now_ns: b"" if isinstance(command, Play) else silent(command, now_ns))
    line.run(100)
    assert line.play() == ["failed"]
    assert line.reports[-1].why == f"no answer to PLAY, asked {ATTEMPTS} times"

    line = Line(bent())
    line.run(100)
    line.session.play(PATTERN, line.now_ns)
    line.run(20)
    assert line.play() == ["failed", "started", "finished"]
    assert [report.why for report in line.reports] == [CUT_SHORT, "", ""]
