"""What the terminal and the shell ask of a flight: Ctrl-C, Ctrl-Z and `fg`, background, a closed window."""

import asyncio
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_INTERRUPTS = (signal.SIGINT, signal.SIGTERM, signal.SIGQUIT)
"""Each would by default end the launcher, as SIGHUP would, and with it everybody in the air."""
_TERMINAL_USE = (signal.SIGTTOU, signal.SIGTTIN)


def in_foreground(terminal: int) -> bool:
    """Says whether this process may read from a terminal and set its modes.

    Args:
        terminal: An open descriptor of it.
    """
    try:
        return os.tcgetpgrp(terminal) == os.getpgrp()
    except OSError:  # not the terminal of this session: no shell shares it out
        return True


def has_shell() -> bool:
    """Says whether there is a shell that could continue this process, were it stopped."""
    return os.getsid(0) != os.getpgrp()


@contextmanager
def watch_signals(on_interrupt: Callable[[], None], on_stop: Callable[[], None]) -> Iterator[None]:
    """Takes what would end or stop this process.

    Using the terminal in the background fails, instead of stopping the process. A closed terminal ends nothing
    that was started with `nohup`.

    Args:
        on_interrupt: Called in the running event loop: the process is asked to end. A hang-up asks only once.
        on_stop: Called there, too: it is asked to stop (Ctrl-Z).
    """
    loop, is_asked = asyncio.get_running_loop(), False

    def interrupt() -> None:
        nonlocal is_asked
        is_asked = True
        on_interrupt()

    def hang_up() -> None:
        # Terminal and shell both tell of a closed window: it hurries nothing that is ending already.
        if not is_asked:
            interrupt()

    handlers = {**dict.fromkeys(_INTERRUPTS, interrupt), signal.SIGHUP: hang_up}
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        del handlers[signal.SIGHUP]
    if signal.getsignal(signal.SIGTSTP) is not signal.SIG_IGN:
        handlers[signal.SIGTSTP] = on_stop
    before = {number: signal.signal(number, signal.SIG_IGN) for number in _TERMINAL_USE}
    for number, handler in handlers.items():
        loop.add_signal_handler(number, handler)
    try:
        yield
    finally:
        for number, previous in before.items():
            signal.signal(number, previous)


def stop_here() -> None:
    """Stops this process as Ctrl-Z does by default; returns when it is continued."""
    before = signal.signal(signal.SIGTSTP, signal.SIG_DFL)
    signal.raise_signal(signal.SIGTSTP)
    signal.signal(signal.SIGTSTP, before)
