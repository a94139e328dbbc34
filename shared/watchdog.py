"""Tells the service manager that the loop turns: systemd's notification protocol over its datagram socket.

A hung loop stops saying so, and systemd starts the process anew (`WatchdogSec` in `deploy/systemd`). Its
presence on the bus would not show it: Zenoh's own threads keep that alive.
"""

import os
import socket
from contextlib import suppress

NOTIFY_SOCKET = "NOTIFY_SOCKET"
"""Environment variable in which systemd says where it listens."""


def feed_watchdog() -> None:
    """Says that the process is up and its loop turns; without a service manager it does nothing.

    Never blocks, never raises: what the manager misses now it hears the next time.
    """
    address = os.environ.get(NOTIFY_SOCKET)
    if address:
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
            line.setblocking(False)
            # A leading @ stands for the zero byte of Linux's abstract sockets.
            line.sendto(b"READY=1\nWATCHDOG=1", address.replace("@", "\0", 1))
