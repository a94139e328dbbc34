"""Whether what a glove says of itself can be true. Pure.

A pattern that was begun can only run out, at the pace of time: what remains of it never grows, is not gone
long before its end and not there long after it. A device that says otherwise is broken, or is no glove; whoever
waited for it would feel nothing more.
"""

from attrs import Factory, define

from glove_bridge.protocol import MAX_FRAMES, MAX_PATTERN_MS, MIN_DEADMAN_MS, MOTORS, Hello, HelloReply

CLOCK = 0.1
"""A device's clock may be off by this share: far more than any resonator is."""
EARLY_MS, LATE_MS = 150, 500
"""And by this much beyond: lines delay, and computers stall."""

_NS_PER_MS = 1_000_000


@define
class Playback:
    """A pattern that the device was asked to play.

    Attributes:
        length_ms: Its length.
        remaining_ms: What was left by the last answer; all of it before the first.
        asked_ns: When it was first asked for, None before its answer: it did not begin earlier.
        begun_ns: When that answer came, None before: it did not begin later.
    """

    length_ms: int
    remaining_ms: int = Factory(lambda playback: playback.length_ms, takes_self=True)
    asked_ns: int | None = None
    begun_ns: int | None = None

    def doubt(self, remaining_ms: int, asked_ns: int, now_ns: int) -> str:
        """Takes the next answer.

        Args:
            remaining_ms: What it says is left, ms.
            asked_ns: When what it answers was first asked.
            now_ns: When the answer came.

        Returns:
            Why it cannot be true, empty if it can.
        """
        if self.asked_ns is None or self.begun_ns is None:
            self.asked_ns, self.begun_ns = asked_ns, now_ns
        before_ms, self.remaining_ms = self.remaining_ms, remaining_ms
        if remaining_ms > before_ms:
            return f"{remaining_ms} ms remain of {before_ms}"
        longest_ms = (now_ns - self.asked_ns) / _NS_PER_MS
        if remaining_ms < self.length_ms - longest_ms * (1.0 + CLOCK) - EARLY_MS:
            return f"{remaining_ms} ms remain {longest_ms:.0f} ms after {self.length_ms} were asked for"
        shortest_ms = (asked_ns - self.begun_ns) / _NS_PER_MS
        if remaining_ms > 0 and shortest_ms > self.length_ms * (1.0 + CLOCK) + LATE_MS:
            return f"a pattern of {self.length_ms} ms still plays after {shortest_ms:.0f}"
        return ""

    def began(self, asked_ns: int, now_ns: int) -> int:
        """Returns when it began by what remains, ns; not before it was asked for."""
        return max(asked_ns, now_ns - (self.length_ms - self.remaining_ms) * _NS_PER_MS)


def doubt_greeting(reply: HelloReply, hello: Hello) -> str:
    """Says why a device that answers a greeting cannot be used, empty if it can."""
    if reply.motors != MOTORS:
        return f"it says that it has {reply.motors} motors, a glove has {MOTORS}"
    if reply.max_frames < MAX_FRAMES or reply.max_pattern_ms < MAX_PATTERN_MS:
        return (
            f"it takes patterns of up to {reply.max_frames} frames and {reply.max_pattern_ms} ms,"
            f" ours have up to {MAX_FRAMES} and {MAX_PATTERN_MS}"
        )
    if not MIN_DEADMAN_MS <= reply.deadman_ms <= hello.deadman_ms:
        return f"it grants a dead-man of {reply.deadman_ms} ms where {hello.deadman_ms} were asked for"
    return ""
