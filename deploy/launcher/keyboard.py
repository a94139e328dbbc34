"""Single keys from the terminal while a flight runs."""

import asyncio
import os
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def key_presses(on_key: Callable[[str], None]) -> Iterator[None]:
    """Calls `on_key` for every key pressed; without a terminal on standard input it does nothing.

    Ctrl-C keeps its meaning. The terminal is restored at the end, whatever happens.

    Args:
        on_key: Called in the running event loop with one character.
    """
    if not sys.stdin or not sys.stdin.isatty():
        yield
        return
    terminal = sys.stdin.fileno()
    loop = asyncio.get_running_loop()
    before = termios.tcgetattr(terminal)
    tty.setcbreak(terminal)
    loop.add_reader(terminal, lambda: _read(terminal, on_key))
    try:
        yield
    finally:
        loop.remove_reader(terminal)
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)


def _read(terminal: int, on_key: Callable[[str], None]) -> None:
    for character in os.read(terminal, 64).decode(errors="ignore"):
        on_key(character)
