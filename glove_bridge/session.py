"""The host's end of the glove's line: greeting, stop and wait, keep-alive. Pure: bytes and time in and out.

One command waits for its answer at a time and is repeated at most twice; `glove_bridge.protocol` makes a
repetition harmless. A newer command does not wait for an older one's answer, it takes its place. When a command
stays unanswered, or the device says that there is no session, the session is lost: what played has failed, and
a HELLO under a new nonce, repeated until it is answered, stops every motor and begins the next one.
"""

from collections.abc import Sequence

from attrs import define, frozen

from glove_bridge.framing import StreamDecoder, encode
from glove_bridge.gloves.base import Outcome, Report
from glove_bridge.protocol import (
    PROTOCOL,
    USB_BAUD,
    USB_DEADMAN_MS,
    XBEE_BAUD,
    XBEE_DEADMAN_MS,
    Ack,
    Command,
    Hello,
    HelloReply,
    Ping,
    Play,
    PlayFrame,
    Set,
    Status,
    Stop,
)
from shared.clock import NS_PER_S

ATTEMPTS = 3
"""How often a command is sent before the session counts as lost."""

PINGS_PER_DEADMAN = 3
_NS_PER_MS = 1_000_000
_BITS_PER_BYTE = 10
_LONGEST_REPLY = 20
_SEQS = 1 << 8
_NONCES = 1 << 16
_DELIVERED = (Status.OK, Status.DUPLICATE)


@frozen(kw_only=True)
class LinkTiming:
    """How fast a line is.

    Attributes:
        baud: Bits per second.
        deadman_ms: Dead-man to ask the device for, ms.
        answer_ms: How long an answer may take beyond the bytes' own time, ms.
        greeting_ms: Time between two HELLOs, ms.
    """

    baud: int
    deadman_ms: int
    answer_ms: int
    greeting_ms: int

    def patience_ns(self, line: bytes) -> int:
        """Returns how long to wait for the answer to some bytes, ns."""
        bits = _BITS_PER_BYTE * (len(line) + _LONGEST_REPLY)
        return self.answer_ms * _NS_PER_MS + bits * NS_PER_S // self.baud


USB = LinkTiming(baud=USB_BAUD, deadman_ms=USB_DEADMAN_MS, answer_ms=60, greeting_ms=100)
XBEE = LinkTiming(baud=XBEE_BAUD, deadman_ms=XBEE_DEADMAN_MS, answer_ms=200, greeting_ms=300)


@define
class _Asked:
    """A command on its way: how often it was sent, and when to do so again."""

    command: Command
    sent: int = 0
    sent_ns: int = 0
    due_ns: int = 0


class Session:
    """The host's side of one line, from one opening of the port to the next.

    Args:
        timing: How fast the line is.
        nonce: Names the first session; drawn at random, so that a device knows a new host.

    Attributes:
        device: What has answered, None while there is no session.
        answers: How many commands were answered.
        retries: Commands that were sent again.
        round_trip_ns: From the last command that was answered at once to its answer; None before.
        fault: Why there is no session, for people; empty while there is one.
    """

    def __init__(self, timing: LinkTiming, nonce: int) -> None:
        self.device: HelloReply | None = None
        self.answers = self.retries = 0
        self.round_trip_ns: int | None = None
        self.fault = "not open"
        self._timing, self._nonce, self._seq = timing, nonce, 0
        self._decoder = StreamDecoder()
        self._asked: _Asked | None = None
        self._playing_ms: int | None = None
        self._ping_ns = 0
        self._reports: list[Report] = []

    @property
    def quiet(self) -> bool:
        """Whether no command waits for its answer; without a session none ever does."""
        return self.device is None or self._asked is None

    def opened(self, now_ns: int) -> None:
        """Notes that the port is open: says HELLO."""
        self._decoder = StreamDecoder()
        self._greet("no answer yet", now_ns)

    def closed(self, why: str, now_ns: int) -> None:
        """Notes that the port is gone."""
        self._end(why, now_ns)
        self._asked = None

    def play(self, frames: Sequence[PlayFrame], now_ns: int) -> None:
        """Plays a whole pattern; one that still plays fails, and this one without a session."""
        self._fail(now_ns)
        if self.device is None:
            self._reports.append(Report(Outcome.FAILED, now_ns))
            return
        command = Play(self._next_seq(), tuple(frames))
        self._playing_ms = command.length_ms
        self._ask(command, now_ns)

    def hold(self, duties: Sequence[int], now_ns: int) -> None:
        """Holds the motors at duties (0..255) until something else is asked for; what played fails."""
        self._fail(now_ns)
        if self.device is not None:
            self._ask(Set(self._next_seq(), tuple(duties)), now_ns)

    def stop(self, now_ns: int) -> None:
        """Stops every motor; what played fails."""
        self._fail(now_ns)
        if self.device is not None:
            self._ask(Stop(self._next_seq()), now_ns)

    def receive(self, data: bytes, now_ns: int) -> None:
        """Takes in what has arrived; no bytes raise."""
        for message in self._decoder.feed(data):
            if isinstance(message, HelloReply):
                self._greeted(message, now_ns)
            elif isinstance(message, Ack):
                self._answered(message, now_ns)

    def due(self, now_ns: int) -> bytes:
        """Returns what is to be written now, in one piece; empty if nothing is."""
        if self._asked is None and self.device is not None and now_ns >= self._ping_ns:
            self._ask(Ping(self._next_seq()), now_ns)
        asked = self._asked
        if asked is None or now_ns < asked.due_ns:
            return b""
        if asked.sent == ATTEMPTS and not isinstance(asked.command, Hello):
            asked = self._greet(f"no answer to {ATTEMPTS} {type(asked.command).__name__.upper()}", now_ns)
        return self._send(asked, now_ns)

    def next_ns(self) -> int | None:
        """Returns when `due` may have something to write; None: not before something happens."""
        if self._asked is not None:
            return self._asked.due_ns
        return self._ping_ns if self.device is not None else None

    def take_reports(self) -> list[Report]:
        """Returns what has become of patterns since the last call, oldest first."""
        reports, self._reports = self._reports, []
        return reports

    def _send(self, asked: _Asked, now_ns: int) -> bytes:
        line = encode(asked.command)
        if isinstance(asked.command, Hello):
            wait_ns = self._timing.greeting_ms * _NS_PER_MS
        else:
            wait_ns = self._timing.patience_ns(line)
            self.retries += asked.sent > 0
        asked.sent, asked.sent_ns, asked.due_ns = asked.sent + 1, now_ns, now_ns + wait_ns
        return line

    def _greet(self, why: str, now_ns: int) -> _Asked:
        """Begins a session anew: the nonce is new, so the device stops whatever it does."""
        self._end(why, now_ns)
        self._nonce, self._seq = (self._nonce + 1) % _NONCES, 0
        return self._ask(Hello(self._seq, self._nonce, self._timing.deadman_ms), now_ns)

    def _greeted(self, reply: HelloReply, now_ns: int) -> None:
        asked = self._asked
        if asked is None or not isinstance(asked.command, Hello) or reply.nonce != self._nonce:
            return
        if reply.protocol != PROTOCOL:
            self.fault = (
                f"its firmware {'.'.join(map(str, reply.firmware))} speaks protocol {reply.protocol}, not"
                f" {PROTOCOL}; flash it: swarmtouch glove flash"
            )
            return
        self.device, self.fault, self._asked = reply, "", None
        self._keep_alive(now_ns)

    def _answered(self, ack: Ack, now_ns: int) -> None:
        asked = self._asked
        if asked is None or isinstance(asked.command, Hello) or ack.seq != asked.command.seq:
            return
        if ack.status in (Status.NO_SESSION, Status.STALE):
            self._greet("the device was reset", now_ns)
            return
        self._asked = None
        self.answers += 1
        if asked.sent == 1:
            self.round_trip_ns = now_ns - asked.sent_ns
        self._keep_alive(now_ns)
        if self._playing_ms is not None:
            self._advance(self._playing_ms, asked.command, ack, now_ns)

    def _advance(self, length_ms: int, command: Command, ack: Ack, now_ns: int) -> None:
        """Reports start and end of what plays, as the device tells them; asks again when it should end."""
        if ack.status not in _DELIVERED:
            self._fail(now_ns)
            return
        if isinstance(command, Play):
            played_ms = max(0, length_ms - ack.remaining_ms)
            self._reports.append(Report(Outcome.STARTED, now_ns - played_ms * _NS_PER_MS))
        if ack.remaining_ms == 0:
            self._playing_ms = None
            self._reports.append(Report(Outcome.FINISHED, now_ns))
            return
        self._ping_ns = min(self._ping_ns, now_ns + ack.remaining_ms * _NS_PER_MS)

    def _keep_alive(self, now_ns: int) -> None:
        if self.device is not None:
            self._ping_ns = now_ns + self.device.deadman_ms * _NS_PER_MS // PINGS_PER_DEADMAN

    def _ask(self, command: Command, now_ns: int) -> _Asked:
        self._asked = _Asked(command, due_ns=now_ns)
        return self._asked

    def _end(self, why: str, now_ns: int) -> None:
        self._fail(now_ns)
        self.device, self.fault = None, why

    def _fail(self, now_ns: int) -> None:
        if self._playing_ms is not None:
            self._playing_ms = None
            self._reports.append(Report(Outcome.FAILED, now_ns))

    def _next_seq(self) -> int:
        self._seq = (self._seq + 1) % _SEQS
        return self._seq
