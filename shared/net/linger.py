"""Lets TCP links go at once when they are closed.

Zenoh has the kernel wait ten seconds for a peer that no longer answers, on a thread that may serve a living
link, which then falls silent as well (zenoh#1101, zenoh#2718).
"""

import os
import socket
import stat
import struct

_AT_ONCE = struct.pack("ii", 0, 0)
"""SO_LINGER off: `close` returns, and the kernel delivers in the background what it still can."""


def stop_lingering() -> None:
    """Clears SO_LINGER on every TCP socket of this process."""
    for name in os.listdir("/dev/fd"):
        try:
            _clear(int(name))
        except OSError:
            continue  # closed meanwhile, or of a kind that has no such option


def _clear(number: int) -> None:
    if not stat.S_ISSOCK(os.fstat(number).st_mode):
        return
    # A duplicate: the number itself may be closed and given away at any moment.
    with socket.socket(fileno=os.dup(number)) as link:
        if link.type == socket.SOCK_STREAM and link.family in (socket.AF_INET, socket.AF_INET6):
            link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE)
