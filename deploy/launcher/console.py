"""A console whose reader may vanish (a closed terminal, `| head`) without ending the flight."""

import sys
from contextlib import suppress
from typing import TextIO, cast

from rich.console import Console


class _SteadyStream:
    """A stream that drops what can no longer be written."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with suppress(OSError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError):
            self._stream.flush()

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)


def open_console(*, stderr: bool) -> Console:
    """Opens a console on stdout or stderr."""
    stream = _SteadyStream(sys.stderr if stderr else sys.stdout)
    return Console(file=cast(TextIO, stream), highlight=False)
