"""A console that shows foreign text as it is, and whose reader may vanish without ending the flight."""

import os
import sys
from typing import Any, TextIO, cast

from rich.console import Console
from rich.text import Text

from shared.plain_text import plain

_LONGEST_LINE = 4000


class PlainConsole(Console):
    """A console to which every string is text: not markup, not emoji, and nothing that a terminal acts upon.

    Rich brings each string here that is printed, or stands in a table. Print strings, no `Text` of your own.
    """

    def render_str(self, text: str, **options: Any) -> Text:
        """See the base class."""
        lines = "\n".join(plain(line, _LONGEST_LINE) for line in text.split("\n"))
        return super().render_str(lines, **(options | {"markup": False, "emoji": False, "highlight": False}))


class _SteadyStream:
    """A stream that turns to nowhere when its reader vanishes (a closed terminal, `| head`)."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        try:
            self._stream.write(text)
        except OSError:
            self._turn_away()
        return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except OSError:
            self._turn_away()

    def _turn_away(self) -> None:
        # What is still buffered would fail once more when the interpreter exits, with its code 120.
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), self._stream.fileno())

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)


def open_console(*, stderr: bool) -> Console:
    """Opens a console on stdout or stderr."""
    stream = _SteadyStream(sys.stderr if stderr else sys.stdout)
    return PlainConsole(file=cast(TextIO, stream), highlight=False)
