"""Reads Zenoh's own log, which it can only write to standard output, and passes everything else on."""

import fcntl
import os
import sys
import threading
import time
from collections.abc import Callable

POLL_S = 0.1
"""How often the pipe is emptied; a wake-up per line would cost the loop its punctuality."""
PIPE_BYTES = 1 << 20
"""Room for what is written between two looks: a full pipe would hold up Zenoh's network threads."""
_STDOUT = 1
_MARKS = (b"zenoh::", b"zenoh_")
"""Every line of its log names the module that wrote it."""


def tap_stdout(on_log: Callable[[str], None]) -> None:
    """Puts a pipe in the place of standard output, for the life of the process.

    Args:
        on_log: Called on a thread of its own with whole lines of Zenoh's log; it must not raise.
    """
    sys.stdout.flush()
    original = os.dup(_STDOUT)
    outlet, inlet = os.pipe()
    if hasattr(fcntl, "F_SETPIPE_SZ"):
        fcntl.fcntl(inlet, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    os.dup2(inlet, _STDOUT)
    os.close(inlet)
    threading.Thread(target=_pump, args=(outlet, original, on_log), name="log-tap", daemon=True).start()


def _pump(outlet: int, original: int, on_log: Callable[[str], None]) -> None:
    rest = b""
    while True:
        time.sleep(POLL_S)
        lines = (rest + os.read(outlet, PIPE_BYTES)).split(b"\n")
        rest = lines.pop()
        log = [line for line in lines if any(mark in line for mark in _MARKS)]
        if log:
            on_log(b"\n".join(log).decode(errors="replace"))
        if others := [line for line in lines if not any(mark in line for mark in _MARKS)]:
            os.write(original, b"\n".join(others) + b"\n")
