"""The operator's orders: lines of one word on standard input."""

import logging
import os
import select

from shared.messages import Wish

ORDERS = {"fly": Wish.FLY, "hold": Wish.HOLD, "land": Wish.LAND, "stop": Wish.STOP}

_MAX_LINE = 80
_log = logging.getLogger("orders")


class OrderReader:
    """Waits for orders on a file descriptor.

    Its end is no order: a relay without a terminal flies on.
    """

    def __init__(self, descriptor: int | None) -> None:
        """Takes an open descriptor, for example that of standard input, or None: no orders ever come."""
        self._descriptors = [] if descriptor is None else [descriptor]
        self._partial = b""

    def wait(self, timeout_s: float) -> list[Wish]:
        """Waits until a line arrives or the time has passed.

        Args:
            timeout_s: Longest wait, s; negative is none.

        Returns:
            The orders so far, oldest first; lines that are none are logged and left out.
        """
        try:
            readable, _, _ = select.select(self._descriptors, [], [], max(0.0, timeout_s))
            if not readable:
                return []
            chunk = os.read(readable[0], 4096)
        except OSError as error:
            _log.warning("no more orders: %s", error)
            chunk = b""
        if not chunk:
            self._descriptors.clear()
            return []
        *lines, rest = (self._partial + chunk).split(b"\n")
        self._partial = rest[:_MAX_LINE]
        return [wish for line in lines if (wish := _parse(line))]


def _parse(line: bytes) -> Wish | None:
    word = line.decode("utf-8", "replace").strip().lower()
    wish = ORDERS.get(word)
    if word and wish is None:
        _log.warning("no order: %.40r; orders: %s", word, ", ".join(ORDERS))
    return wish
