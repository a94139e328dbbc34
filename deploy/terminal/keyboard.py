"""Single keys from the terminal while a flight runs, whenever the terminal is this process's."""

import asyncio
import os
import sys
import termios
import tty
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from deploy.terminal.job_control import in_foreground

_LOCAL_MODES = 3
"""Where `termios.tcgetattr` has the local modes."""


class Keyboard:
    """Calls back for every key pressed; without a terminal on standard input it does nothing.

    Ctrl-C and Ctrl-Z keep their meaning. A shell may put the process into the background, bring it back and set
    the terminal's modes as it likes, all without a signal: so the terminal is looked at again and again.

    Args:
        on_key: Called in the running event loop with one character.
    """

    def __init__(self, on_key: Callable[[str], None]) -> None:
        self._on_key = on_key
        self._loop = asyncio.get_running_loop()
        self._terminal = sys.stdin.fileno() if sys.stdin and sys.stdin.isatty() else None
        self._before: list[Any] | None = None
        self._reads = False

    def attend(self) -> None:
        """Takes single keys if the terminal is ours, keeps off it if not; call it about 20 times a second."""
        if self._terminal is None:
            return
        try:
            if in_foreground(self._terminal):
                self._take(self._terminal)
            else:
                self._ignore()
        except (OSError, termios.error):  # the terminal is gone
            self._ignore()
            self._terminal = None

    def close(self) -> None:
        """Leaves the terminal as it was, if it is ours; `attend` takes it again."""
        self._ignore()
        if self._terminal is None or self._before is None:
            return
        with suppress(OSError, termios.error):
            if in_foreground(self._terminal):
                # Not after what is still to be printed: the reader may have stopped it with Ctrl-S.
                termios.tcsetattr(self._terminal, termios.TCSANOW, self._before)

    def _take(self, terminal: int) -> None:
        modes = termios.tcgetattr(terminal)
        if modes[_LOCAL_MODES] & termios.ICANON:
            self._before = modes
            tty.setcbreak(terminal, termios.TCSANOW)
        if not self._reads:
            self._loop.add_reader(terminal, self._read, terminal)
            self._reads = True

    def _ignore(self) -> None:
        if self._reads and self._terminal is not None:
            self._loop.remove_reader(self._terminal)
        self._reads = False

    def _read(self, terminal: int) -> None:
        try:
            keys = os.read(terminal, 64)
        except OSError:
            keys = b""
        if not keys:  # gone, or somebody else's just now
            self._ignore()
        for character in keys.decode(errors="ignore"):
            self._on_key(character)
