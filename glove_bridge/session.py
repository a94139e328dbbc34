"""The host's end of the glove's line: greeting, stop and wait, keep-alive. Pure: bytes and time in and out.

One command waits for its answer at a time and is repeated at most twice; `glove_bridge.protocol` makes a
repetition harmless. A newer command does not wait for an older one's answer, it takes its place. When a command
stays unanswered, or the device says that there is no session, the session is lost: what played has failed, and
a HELLO under a new nonce, repeated until it is answered, stops every motor and begins the next one.

What a device says is believed as far as it can be true (`glove_bridge.plausible`): a pattern never outlasts its
length by much, whatever the device answers. A device that contradicts itself is greeted anew, and counts as
unusable until it has played a pattern as it should.
"""

from collections import Counter
from collections.abc import Sequence

from attrs import define

from glove_bridge.framing import StreamDecoder, encode
from glove_bridge.gloves.base import CUT_SHORT, Outcome, Report
from glove_bridge.link_timing import LinkTiming
from glove_bridge.plausible import Playback, doubt_greeting
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
    Set,
    Status,
    Stop,
)

ATTEMPTS = 3
"""How often a command is sent before the session counts as lost."""

PINGS_PER_DEADMAN = 3
UNANSWERED = "no answer yet"
NOT_A_GLOVE = "answers, but not as a glove: wrong port or baud?"

_SHORTEST_PING_NS = 5_000_000
"""A device that has almost finished is asked again after so long."""
_CHATTER = 16
"""Bytes that a starting board may say before it is one."""
_NS_PER_MS = 1_000_000
_SEQS = 1 << 8
_NONCES = 1 << 16
_DELIVERED = (Status.OK, Status.DUPLICATE)


@define
class _Asked:
    """A command on its way: how often it was sent, bytes that came since; when first, last, and when again."""

    command: Command
    sent: int = 0
    heard: int = 0
    first_ns: int = 0
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
        rejected: What came and was no message, or could not be true, by reason.
        babble: Bytes since the port was opened, while there has been no session on it.
        round_trip_ns: From the last command that was answered at once to its answer; None before.
        fault: Why patterns cannot be felt, for people; empty while they can.
    """

    def __init__(self, timing: LinkTiming, nonce: int) -> None:
        self.device: HelloReply | None = None
        self.answers = self.retries = 0
        self.rejected: Counter[str] = Counter()
        self.babble = 0
        self.round_trip_ns: int | None = None
        self.fault = "not open"
        self._timing, self._nonce, self._seq = timing, nonce, 0
        self._decoder = StreamDecoder(self.rejected)
        self._doubt = ""
        self._met = False
        self._asked: _Asked | None = None
        self._playing: Playback | None = None
        self._held = False
        self._ping_ns = self._next_greeting_ns = 0
        self._reports: list[Report] = []

    @property
    def quiet(self) -> bool:
        """Whether no command waits for its answer; without a session none ever does."""
        return self.device is None or self._asked is None

    def opened(self, now_ns: int) -> None:
        """Notes that the port is open: says HELLO."""
        self._decoder, self._met, self.babble = StreamDecoder(self.rejected), False, 0
        self._greet(UNANSWERED, now_ns)

    def closed(self, why: str, now_ns: int) -> None:
        """Notes that the port is gone."""
        self._end(why, now_ns)
        self._asked = None

    def play(self, frames: Sequence[PlayFrame], now_ns: int) -> None:
        """Plays a whole pattern; one that still plays fails, and this one if there is no device."""
        self._fail(CUT_SHORT, now_ns)
        if self.device is None:
            self.refuse(self.fault, now_ns)
            return
        self._playing, self._held = Playback(sum(frame.ms for frame in frames)), False
        self._ask(Play(self._next_seq(), tuple(frames), session=self._nonce), now_ns)

    def refuse(self, why: str, now_ns: int) -> None:
        """Reports a pattern as failed that is not even asked for."""
        self._reports.append(Report(Outcome.FAILED, now_ns, why))

    def hold(self, duties: Sequence[int], now_ns: int) -> None:
        """Holds the motors at duties (0..255) until something else is asked for; what played fails."""
        self._fail(CUT_SHORT, now_ns)
        if self.device is not None:
            self._held = True
            self._ask(Set(self._next_seq(), tuple(duties), session=self._nonce), now_ns)

    def stop(self, now_ns: int) -> None:
        """Stops every motor; what played fails."""
        self._fail(CUT_SHORT, now_ns)
        if self.device is not None:
            self._held = False
            self._ask(Stop(self._next_seq(), session=self._nonce), now_ns)

    def receive(self, data: bytes, now_ns: int) -> None:
        """Takes in what has arrived; no bytes raise."""
        self.babble += 0 if self._met else len(data)
        if self._asked is not None:
            self._asked.heard += len(data)
        for message in self._decoder.feed(data):
            if isinstance(message, HelloReply):
                self._greeted(message, now_ns)
            elif isinstance(message, Ack):
                self._answered(message, now_ns)

    def due(self, now_ns: int) -> bytes:
        """Returns what is to be written now, in one piece; empty if nothing is."""
        if self._asked is None and self.device is not None and now_ns >= self._ping_ns:
            self._ask(Ping(self._next_seq(), session=self._nonce), now_ns)
        asked = self._asked
        if asked is None or now_ns < asked.due_ns:
            return b""
        if asked.sent == ATTEMPTS and not isinstance(asked.command, Hello):
            asked = self._greet(_unanswered(asked), now_ns)
        return self._send(asked, now_ns) if now_ns >= asked.due_ns else b""

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
            self._next_greeting_ns = now_ns + wait_ns
            if asked.sent > 1 and self.babble > _CHATTER and self.fault == UNANSWERED:
                self.fault = NOT_A_GLOVE
        else:
            wait_ns = self._timing.patience_ns(line)
            self.retries += asked.sent > 0
        if asked.sent == 0:
            asked.first_ns = now_ns
        asked.sent, asked.sent_ns, asked.due_ns = asked.sent + 1, now_ns, now_ns + wait_ns
        return line

    def _greet(self, why: str, now_ns: int) -> _Asked:
        """Begins a session anew: the nonce is new, so the device stops whatever it does.

        However often a device gives cause for it, greetings are no closer than their own time.
        """
        self._end(why, now_ns)
        self._nonce, self._seq = (self._nonce + 1) % _NONCES, 0
        hello = Hello(self._seq, self._nonce, self._timing.deadman_ms)
        return self._ask(hello, max(now_ns, self._next_greeting_ns))

    def _greeted(self, reply: HelloReply, now_ns: int) -> None:
        asked = self._asked
        if asked is None or not isinstance(asked.command, Hello) or reply.seq != asked.command.seq:
            return
        if reply.protocol != PROTOCOL:  # such a device does not tell by the nonce whom it answers
            self.fault = (
                f"its firmware {'.'.join(map(str, reply.firmware))} speaks protocol {reply.protocol}, not"
                f" {PROTOCOL}; flash it: swarmtouch glove flash"
            )
            return
        if reply.nonce != self._nonce:
            return
        doubt = doubt_greeting(reply, asked.command)
        if doubt:
            self.fault = doubt
            self.rejected["untrue"] += 1
            return
        self.device, self._met, self._asked = reply, True, None
        self._ping_ns = now_ns  # whether it also obeys is seen at once

    def _answered(self, ack: Ack, now_ns: int) -> None:
        asked = self._asked
        if asked is None or isinstance(asked.command, Hello):
            return
        if (ack.seq, ack.session) != (asked.command.seq, asked.command.session):
            return
        if ack.status in (Status.NO_SESSION, Status.STALE):
            self._greet(self._doubt or "the device was reset", now_ns)
            return
        self._asked = None
        self.answers += 1
        if asked.sent == 1:
            self.round_trip_ns = now_ns - asked.sent_ns
        self._keep_alive(now_ns)
        if ack.status in _DELIVERED:
            self._advance(asked, ack, now_ns)
        elif isinstance(asked.command, Play | Set):
            self._fail(f"it refuses {_name(asked.command)}: {ack.status.name}", now_ns)
            self.stop(now_ns)  # or what was there before would go on
        else:
            self._believe(f"it refuses {_name(asked.command)}: {ack.status.name}", now_ns)

    def _advance(self, asked: _Asked, ack: Ack, now_ns: int) -> None:
        """Reports start and end of what plays, as the device tells them; asks again when it should end."""
        playing = self._playing
        if playing is None:
            idle = {0, HELD} if self._held else {0}
            self._believe("" if ack.remaining_ms in idle else "something plays that nobody asked for", now_ns)
            return
        if not self._believe(playing.doubt(ack.remaining_ms, asked.first_ns, now_ns), now_ns):
            return
        if isinstance(asked.command, Play):
            self._reports.append(Report(Outcome.STARTED, playing.began(asked.first_ns, now_ns)))
        if ack.remaining_ms == 0:
            self._playing, self._doubt, self.fault = None, "", ""
            self._reports.append(Report(Outcome.FINISHED, now_ns))
            return
        self._ping_ns = min(self._ping_ns, now_ns + max(ack.remaining_ms * _NS_PER_MS, _SHORTEST_PING_NS))

    def _believe(self, doubt: str, now_ns: int) -> bool:
        """Adopts an answer, or begins anew with a device that says what cannot be."""
        if doubt:
            self.rejected["untrue"] += 1
            self._doubt = f"its answers cannot be true: {doubt}"
            self._greet(self._doubt, now_ns)
        else:
            self.fault = self._doubt
        return not doubt

    def _keep_alive(self, now_ns: int) -> None:
        if self.device is not None:
            self._ping_ns = now_ns + self.device.deadman_ms * _NS_PER_MS // PINGS_PER_DEADMAN

    def _ask(self, command: Command, due_ns: int) -> _Asked:
        self._asked = _Asked(command, due_ns=due_ns)
        return self._asked

    def _end(self, why: str, now_ns: int) -> None:
        self._fail(why, now_ns)
        self.device, self.fault, self._held = None, why, False

    def _fail(self, why: str, now_ns: int) -> None:
        if self._playing is not None:
            self._playing = None
            self._reports.append(Report(Outcome.FAILED, now_ns, why))

    def _next_seq(self) -> int:
        self._seq = (self._seq + 1) % _SEQS
        return self._seq


def _unanswered(asked: _Asked) -> str:
    said = "what it says is no answer to" if asked.heard else "no answer to"
    return f"{said} {_name(asked.command)}, asked {asked.sent} times"


def _name(command: Command) -> str:
    return type(command).__name__.upper()
