"""`terminal://`: five fingers in the terminal, redrawn in place; elsewhere one line per frame."""

import logging
import sys
from typing import TextIO

from glove_bridge.gloves.base import CLOSED
from glove_bridge.gloves.timed import TimedGlove
from glove_bridge.patterns.pattern import Frame, Pattern
from glove_bridge.patterns.schema import FINGERS
from shared.uri import Uri

_REST = "·"
_LEVELS = ((175.0, "░"), (225.0, "▒"), (float("inf"), "█"))
"""Up to which frequency a finger looks like this, Hz: the paper's are 150, 200 and 250."""
_WIDTH = 3
_log = logging.getLogger("glove")


class TerminalGlove(TimedGlove):
    """Draws on a stream.

    Args:
        uri: There is nothing to choose in it.
        stream: Where to draw; standard output by default.
    """

    def __init__(self, uri: Uri | None = None, stream: TextIO | None = None) -> None:
        super().__init__()
        if uri is not None:
            self.check(uri)
        self._stream: TextIO | None = stream or sys.stdout
        self._in_place = self._stream.isatty()

    def close(self) -> None:
        """See `Glove.close`."""
        if self._stream is not None and self._in_place:
            self._write("\n")
        self._stream, self.fault = None, CLOSED

    def _show(self, pattern: Pattern | None, frame: Frame | None, now_ns: int) -> None:  # noqa: ARG002  interface
        line = f"{draw(frame)}  {pattern.name if pattern else ''}"
        if self._in_place:
            self._write(f"\r\x1b[K{line}")
        elif frame is not None:
            self._write(f"{line}\n")

    def _write(self, text: str) -> None:
        if self._stream is None:
            return
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError) as error:
            _log.warning("the terminal is gone (%s); patterns are no longer drawn", error)
            self._stream, self.fault = None, f"the terminal is gone: {error}"


def draw(frame: Frame | None) -> str:
    """Draws five fingers, the thumb at the left: darker is stronger, a dot is at rest."""
    hz = frame.hz if frame else {}
    return " ".join((_mark(hz[finger]) if finger in hz else _REST) * _WIDTH for finger in FINGERS)


def _mark(hz: float) -> str:
    return next(mark for limit, mark in _LEVELS if hz <= limit)
