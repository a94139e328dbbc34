"""The referee's numbers on disk."""

import json
import logging
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Self

FILE_NAME = "referee.json"
PERIOD_S = 1.0

Numbers = Callable[[], Mapping[str, float]]

_log = logging.getLogger("world")


class RefereeFile:
    """`referee.json`, rewritten once a second and once more at the end, always complete.

    A full or missing disk is logged, not raised: the world flies on.

    Args:
        run_dir: Folder of the run, made if it is missing; None writes nothing.
    """

    def __init__(self, run_dir: Path | None) -> None:
        self._run_dir = run_dir
        self._due = -float("inf")
        self._numbers: Numbers | None = None

    def write_when_due(self, now: float, numbers: Numbers) -> None:
        """Writes if the last time is a second ago.

        Args:
            now: Monotonic time, s.
            numbers: Called for what to write, now or at the end.
        """
        self._numbers = numbers
        if now >= self._due:
            self._due = now + PERIOD_S
            self._write()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._write()

    def _write(self) -> None:
        if self._run_dir is None or self._numbers is None:
            return
        partial = self._run_dir / f"{FILE_NAME}.partial"
        try:
            self._run_dir.mkdir(parents=True, exist_ok=True)
            partial.write_text(json.dumps(self._numbers(), indent=1) + "\n", encoding="utf-8")
            os.replace(partial, self._run_dir / FILE_NAME)
        except OSError as error:
            _log.warning("cannot write %s: %s", self._run_dir / FILE_NAME, error)
