"""The host's end of the glove's line: virtual time, a simulated device, a line that loses frames."""

from collections.abc import Callable, Iterable, Iterator
from itertools import chain, repeat

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glove_bridge.framing import StreamDecoder, encode
from glove_bridge.gloves.base import Report
from glove_bridge.link_timing import USB, XBEE, LinkTiming
from glove_bridge.protocol import PROTOCOL, Ack, Hello, HelloReply, Ping, Play, PlayFrame, Set, Status, Stop
from glove_bridge.session import ATTEMPTS, Session
from tests.simulated_glove import MS, OFF, Device

STRONG, WEAK = (0, 0, 200, 0, 0), (90, 0, 0, 0, 90)
PATTERN = (PlayFrame(200, STRONG), PlayFrame(100, WEAK))
LENGTH_MS = 300
PLAY = 4
"""Number of the frame with the first pattern, when nothing was lost before: HELLO, PING and their answers."""


class Line:
    """Host and device, one millisecond at a time; `losses` says of each frame whether the line loses it."""

    def __init__(self, timing: LinkTiming = USB, losses: Iterable[bool] = ()) -> None:
        self.device, self.session = Device(), Session(timing, nonce=7)
        self.losses: Iterator[bool] = chain(losses, repeat(False))
        self.now_ns = 0
        self.asked: list[object] = []
        self.reports: list[Report] = []
        self._decoder = StreamDecoder()
        self._delay: list[tuple[int, bytes]] = []

    def run(self, ms: int) -> None:
        for _ in range(ms):
            self._step()
            self.now_ns += MS

    def _step(self) -> None:
        for due_ns, data in self._delay[:]:
            if due_ns <= self.now_ns:
                self._delay.remove((due_ns, data))
                self.session.receive(data, self.now_ns)
        for message in self._decoder.feed(self.session.due(self.now_ns)):
            assert not isinstance(message, Ack | HelloReply)
            self.asked.append(message)
            if next(self.losses):
                continue
            reply = encode(self.device.answer(message, self.now_ns))
            if not next(self.losses):
                self._delay.append((self.now_ns + 2 * MS, reply))
        self.device.tick(self.now_ns)
        self.reports += self.session.take_reports()

    def open(self) -> None:
        self.session.opened(self.now_ns)
        self.run(20)
        assert self.session.device is not None

    def play(self) -> None:
        self.session.play(PATTERN, self.now_ns)

    def outcomes(self) -> list[str]:
        return [report.outcome.value for report in self.reports]

    def names(self) -> list[str]:
        return [type(message).__name__ for message in self.asked]


def losing(*lost: int) -> list[bool]:
    """Loses the frames with these numbers, counted from the first HELLO, host and device together."""
    return [k in lost for k in range(max(lost) + 1)]


def test_it_greets_until_somebody_answers() -> None:
    line = Line(losses=losing(0, 1, 2, 4))
    line.session.opened(0)
    line.run(350)
    assert line.names() == ["Hello"] * 4
    assert len({message.nonce for message in line.asked if isinstance(message, Hello)}) == 1
    assert line.session.fault == "no answer yet"
    line.run(60)
    assert line.session.device is not None
    assert line.session.device.deadman_ms == USB.deadman_ms
    assert line.session.fault == ""


def test_a_pattern_is_reported_as_the_device_tells_it() -> None:
    line = Line()
    line.open()
    begun_ns = line.now_ns
    line.play()
    line.run(400)
    assert line.outcomes() == ["started", "finished"]
    started, finished = line.reports
    assert started.at_ns - begun_ns == 2 * MS
    assert LENGTH_MS <= (finished.at_ns - begun_ns) / MS <= LENGTH_MS + 10
    assert line.device.plays == [PATTERN]
    assert [duties for _, duties in line.device.log] == [STRONG, WEAK, OFF]


def test_a_lost_answer_is_asked_for_again_and_the_pattern_plays_once() -> None:
    line = Line(losses=losing(PLAY + 1))
    line.open()
    begun_ns = line.now_ns
    line.play()
    line.run(500)
    assert line.outcomes() == ["started", "finished"]
    # The answer came late, but it tells how much is left: the pattern began when it began.
    assert abs(line.reports[0].at_ns - begun_ns) <= 3 * MS
    assert len(line.device.plays) == 1
    assert line.session.retries == 1


def test_a_pattern_that_is_never_heard_fails_after_two_repetitions_and_a_new_session_begins() -> None:
    line = Line(losses=losing(PLAY, PLAY + 1, PLAY + 2))
    line.open()
    line.play()
    line.run(400)
    assert line.names()[:7] == ["Hello", "Ping", "Play", "Play", "Play", "Hello", "Ping"]
    assert line.outcomes() == ["failed"]
    assert line.device.plays == []
    first, second = (message.nonce for message in line.asked if isinstance(message, Hello))
    assert second != first
    line.play()
    line.run(400)
    assert line.outcomes()[1:] == ["started", "finished"]


def test_a_pattern_whose_answers_are_all_lost_is_stopped() -> None:
    line = Line(losses=losing(PLAY + 1, PLAY + 3, PLAY + 5))
    line.open()
    begun_ns = line.now_ns
    line.play()
    line.run(500)
    assert line.outcomes() == ["failed"]
    when_ns, duties = line.device.log[-1]
    assert duties == OFF
    assert when_ns - begun_ns < (LENGTH_MS - 50) * MS


def test_pings_keep_the_dead_man_away() -> None:
    for timing in (USB, XBEE):
        line = Line(timing)
        line.open()
        line.session.hold(WEAK, line.now_ns)
        line.run(5_000)
        assert [duties for _, duties in line.device.log] == [WEAK]
        assert set(line.names()) == {"Hello", "Set", "Ping"}
        pings = line.names().count("Ping")
        assert 2.5 * 5_000 / timing.deadman_ms < pings < 3.5 * 5_000 / timing.deadman_ms


def test_stop_silences_and_a_newer_command_does_not_wait_for_an_answer() -> None:
    line = Line()
    line.open()
    line.play()
    line.run(1)
    line.session.stop(line.now_ns)
    line.run(50)
    assert line.outcomes() == ["failed"]
    assert line.device.duties == OFF
    assert line.names()[-2:] == ["Play", "Stop"]
    line.session.stop(line.now_ns)
    line.play()
    line.run(1)
    line.play()
    line.run(400)
    assert line.outcomes() == ["failed", "failed", "started", "finished"]


def test_a_device_that_was_reset_is_greeted_again() -> None:
    line = Line()
    line.open()
    line.play()
    line.run(100)
    line.device = Device()
    line.run(400)
    assert line.outcomes() == ["started", "failed"]
    assert line.session.device is not None
    assert line.device.duties == OFF


def test_without_a_device_everything_fails_at_once() -> None:
    session = Session(USB, nonce=0)
    session.play(PATTERN, 5)
    session.stop(6)
    session.hold(WEAK, 7)
    assert session.take_reports() == [("failed", 5, "not open")]
    assert session.due(8) == b""
    assert session.next_ns() is None


def test_closing_fails_what_plays() -> None:
    line = Line()
    line.open()
    line.play()
    line.run(10)
    line.session.closed("unplugged", line.now_ns)
    line.run(10)
    assert line.outcomes() == ["started", "failed"]
    assert line.session.fault == "unplugged"
    assert line.session.due(line.now_ns) == b""


def test_a_device_of_another_protocol_is_named_and_not_used() -> None:
    line = Line()
    line.device = Device(PROTOCOL + 1)
    line.session.opened(0)
    line.run(1_000)
    assert line.session.device is None
    assert f"speaks protocol {PROTOCOL + 1}, not {PROTOCOL}; flash it" in line.session.fault
    line.play()
    line.run(10)
    assert line.outcomes() == ["failed"]


def test_a_refused_pattern_fails_and_the_session_lives() -> None:
    session = opened_session()
    session.play(PATTERN, 0)
    asked = said(session, 0)
    session.receive(encode(Ack(asked.seq, Status.BAD_BODY, 0, 0, session=asked.session)), MS)
    assert session.take_reports() == [("failed", MS, "it refuses PLAY: BAD_BODY")]
    assert session.device is not None
    assert isinstance(said(session, MS), Stop), "what was there before does not go on"


def opened_session() -> Session:
    session = Session(USB, nonce=0)
    session.opened(0)
    device = Device()
    for _ in range(2):
        (command,) = StreamDecoder().feed(session.due(0))
        assert not isinstance(command, Ack | HelloReply)
        session.receive(encode(device.answer(command, 0)), 0)
    assert session.fault == ""
    return session


def said(session: Session, now_ns: int) -> Play | Set | Stop | Ping:
    """Returns the command that a session has for the device."""
    (command,) = StreamDecoder().feed(session.due(now_ns))
    assert isinstance(command, Play | Set | Stop | Ping)
    return command


def test_the_next_deadline_is_never_missed() -> None:
    session = opened_session()
    now_ns, asked = 0, 0
    for _ in range(ATTEMPTS + 1):
        due_ns = session.next_ns()
        assert due_ns is not None
        assert due_ns >= now_ns
        assert session.due(due_ns - 1) == b""
        now_ns, asked = due_ns, asked + bool(session.due(due_ns))
    assert asked == ATTEMPTS + 1


@given(st.binary(max_size=300))
def test_no_bytes_raise(data: bytes) -> None:
    session = opened_session()
    session.play(PATTERN, 0)
    session.due(0)
    session.receive(data, MS)
    session.take_reports()


@pytest.mark.parametrize("kind", [Play, Set, Stop, Ping])
def test_every_command_has_a_number_of_its_own(kind: type) -> None:
    line = Line()
    line.open()
    asking: dict[type, Callable[[], None]] = {
        Play: line.play,
        Set: lambda: line.session.hold(WEAK, line.now_ns),
        Stop: lambda: line.session.stop(line.now_ns),
        Ping: lambda: line.run(120),
    }
    for _ in range(300):
        asking[kind]()
        line.run(5)
    commands = [message for message in line.asked if isinstance(message, kind)]
    assert len(commands) >= 300
    assert line.session.retries == 0
    assert line.names().count("Hello") == 1


@given(
    losses=st.lists(st.booleans(), max_size=80),
    wishes=st.lists(st.tuples(st.sampled_from(["play", "stop"]), st.integers(1, 400)), max_size=5),
)
def test_whatever_is_lost_no_pattern_is_and_no_motor_stays_on(
    losses: list[bool], wishes: list[tuple[str, int]]
) -> None:
    line = Line(losses=[False, False, False, False, *losses])
    line.open()
    played = 0
    for wish, ms in wishes:
        if wish == "play":
            line.play()
            played += 1
        else:
            line.session.stop(line.now_ns)
        line.run(ms)
    line.losses = repeat(False)
    line.run(1_500)
    assert line.session.device is not None
    assert line.device.duties == OFF
    ends = [outcome for outcome in line.outcomes() if outcome != "started"]
    assert len(ends) == played
    assert line.outcomes().count("started") <= len(line.device.plays) <= played
    # At worst the last pattern got through with its second repetition, and the session ended then.
    assert not line.device.log or line.device.log[-1][0] <= line.now_ns - 1_500 * MS + 800 * MS
