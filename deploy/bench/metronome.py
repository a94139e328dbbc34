"""The hand of the floor: a payload at a fixed rate."""

import threading
import time

from deploy.bench.hop import HAND_ID, Token, pack
from shared.clock import Clock
from shared.transport import Publish


def tick(publish: Publish, size: int, rate_hz: float, clock: Clock, stopping: threading.Event) -> None:
    """Sends samples numbered from 1 until told to stop.

    Args:
        publish: Sends one.
        size: Bytes of each.
        rate_hz: How many per second.
        clock: Stamps them.
        stopping: Ends it.
    """
    number, start = 0, time.monotonic()
    while not stopping.wait(max(0.0, start + number / rate_hz - time.monotonic())):
        number += 1
        now = clock()
        publish(pack(Token(HAND_ID, number, now, now, now, number), size))
