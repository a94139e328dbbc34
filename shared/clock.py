"""One clock per process: monotonic ticks, aligned once with the wall clock.

Every stamp of a process (publication, arrival, step) comes from its one clock, so differences within a
process never jump, and on one machine the clocks of two processes agree to microseconds. No safety decision
ever compares the clocks of two processes (DESIGN section 3).
"""

import time
from collections.abc import Callable
from typing import Final

NS_PER_S: Final = 1_000_000_000

Clock = Callable[[], int]
"""Returns the source clock in nanoseconds since the epoch."""


def system_clock() -> Clock:
    """Returns a clock of monotonic nanoseconds, offset to the wall clock of this moment."""
    offset = time.time_ns() - time.monotonic_ns()
    return lambda: time.monotonic_ns() + offset
