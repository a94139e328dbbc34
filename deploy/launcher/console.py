"""A console whose reader may vanish (a closed terminal, `| head`) without ending the flight."""

import os
import sys
from typing import TextIO, cast

from rich.console import Console


class _SteadyStream:
    """A stream that turns to nowhere when its reader vanishes."""

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
    return Console(file=cast(TextIO, stream), highlight=False)
