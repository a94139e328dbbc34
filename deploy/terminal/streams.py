"""Streams whose reader may vanish (a closed terminal, `| head`) or stall (Ctrl-S) without harm."""

import os
import queue
import threading
from contextlib import suppress
from typing import Self, TextIO

_LONGEST_QUEUE = 4096
"""Pieces of text that wait for a reader; more are left out."""


class SteadyStream:
    """A stream that turns to nowhere when its reader vanishes.

    Args:
        stream: Where the text goes.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Writes, if anybody reads."""
        try:
            self._stream.write(text)
        except OSError:
            self._turn_away()
        return len(text)

    def flush(self) -> None:
        """Flushes, if anybody reads."""
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


class PatientStream(SteadyStream):
    """A steady stream that nobody who writes has to wait for: a thread hands the text on.

    It is a context, and at its end waits for the reader.

    Args:
        stream: Where the text goes.
    """

    def __init__(self, stream: TextIO) -> None:
        super().__init__(stream)
        self._queue: queue.Queue[str | None] = queue.Queue(_LONGEST_QUEUE)
        self._writer = threading.Thread(target=self._hand_on, name="output", daemon=True)
        self._writer.start()

    def write(self, text: str) -> int:
        """Takes text, which is on its way at once."""
        with suppress(queue.Full):
            self._queue.put_nowait(text)
        return len(text)

    def flush(self) -> None:
        """Waits for nobody."""

    def settle(self, limit_s: float) -> None:
        """Waits until all that was written is with its reader, or, where that stalls, for `limit_s`."""
        with self._queue.all_tasks_done:
            self._queue.all_tasks_done.wait_for(lambda: not self._queue.unfinished_tasks, limit_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._queue.put(None)
        self._writer.join()

    def _hand_on(self) -> None:
        while (text := self._queue.get()) is not None:
            super().write(text)
            super().flush()
            self._queue.task_done()
