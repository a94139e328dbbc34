"""The part that gloves without a clock of their own share: which frame is on when."""

from abc import ABC, abstractmethod
from collections import Counter

from glove_bridge.gloves.base import CUT_SHORT, Outcome, Report
from glove_bridge.patterns.pattern import Frame, Pattern
from shared.uri import Uri

_NS_PER_MS = 1_000_000


class TimedGlove(ABC):
    """Times the frames by the clock that it is polled with; see `Glove`.

    A frame that was due while nobody polled is skipped, never played late: a pattern keeps its length.

    Attributes:
        fault: See `Glove.fault`.
        rejected: Nothing: there is no device that could say anything.
    """

    def __init__(self) -> None:
        self.fault = ""
        self.rejected: Counter[str] = Counter()
        self._pattern: Pattern | None = None
        self._started_ns = 0
        self._frame = -1
        self._reports: list[Report] = []

    @staticmethod
    def check(uri: Uri) -> None:
        """See `GloveBackend.check`."""
        uri.refuse_unknown()

    @property
    def connected(self) -> bool:
        """See `Glove.connected`."""
        return not self.fault

    def play(self, pattern: Pattern, now_ns: int) -> None:
        """See `Glove.play`; the first frame is shown before it returns."""
        self._cut(now_ns)
        if not self.connected:
            self._reports.append(Report(Outcome.FAILED, now_ns, self.fault))
            return
        self._pattern, self._started_ns, self._frame = pattern, now_ns, -1
        self._reports.append(Report(Outcome.STARTED, now_ns))
        self._advance(now_ns)

    def poll(self, now_ns: int) -> list[Report]:
        """See `Glove.poll`."""
        self._advance(now_ns)
        reports, self._reports = self._reports, []
        return reports

    def next_ns(self) -> int | None:
        """See `Glove.next_ns`."""
        return None if self._pattern is None else self._end_ns(self._pattern, self._frame)

    def stop(self, now_ns: int) -> None:
        """See `Glove.stop`."""
        if self._pattern is not None:
            self._cut(now_ns)
            self._show(None, None, now_ns)

    @abstractmethod
    def close(self) -> None:
        """See `Glove.close`."""

    @abstractmethod
    def _show(self, pattern: Pattern | None, frame: Frame | None, now_ns: int) -> None:
        """Makes the fingers vibrate as the frame says, none at the end of a pattern; raises nothing."""

    def _advance(self, now_ns: int) -> None:
        pattern = self._pattern
        if pattern is None:
            return
        due = self._frame
        while due < len(pattern.frames) and now_ns >= self._end_ns(pattern, due):
            due += 1
        if due == len(pattern.frames):
            self._pattern = None
            self._reports.append(Report(Outcome.FINISHED, self._end_ns(pattern, due - 1)))
            self._show(pattern, None, now_ns)
        elif due != self._frame:
            self._frame = due
            self._show(pattern, pattern.frames[due], now_ns)
            if not self.connected:
                self._cut(now_ns)

    def _end_ns(self, pattern: Pattern, frame: int) -> int:
        """Returns when a frame ends; frame -1 ends where the first begins."""
        return self._started_ns + _NS_PER_MS * sum(f.ms for f in pattern.frames[: frame + 1])

    def _cut(self, now_ns: int) -> None:
        if self._pattern is not None:
            self._pattern = None
            self._reports.append(Report(Outcome.FAILED, now_ns, self.fault or CUT_SHORT))
