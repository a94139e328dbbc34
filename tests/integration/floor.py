"""What this machine gives to whoever only waits: by this every timing of a real flight is judged.

A test must hold beside another build on the same processors, so no time in it stands alone: it is allowed to be
as much worse than on a quiet machine as a thread that does nothing fared meanwhile.
"""

import threading
from bisect import bisect_left
from typing import Self

import numpy as np

from shared.clock import NS_PER_S, Clock, system_clock

PERIOD_NS = NS_PER_S // 60


class Floor(threading.Thread):
    """A thread that wants to wake 60 times a second, and notes when it did.

    Args:
        clock: Stamps what it notes.
    """

    def __init__(self, clock: Clock | None = None) -> None:
        super().__init__(name="floor", daemon=True)
        self._clock = clock or system_clock()
        self._woke_ns: list[int] = []
        self._late_ns: list[int] = []
        self._ending = threading.Event()
        self.start()

    def run(self) -> None:
        due_ns = self._clock()
        while not self._ending.is_set():
            due_ns = max(due_ns, self._clock() - PERIOD_NS) + PERIOD_NS
            self._ending.wait((due_ns - self._clock()) / NS_PER_S)
            now_ns = self._clock()
            self._late_ns.append(now_ns - due_ns)
            self._woke_ns.append(now_ns)

    def late_ms(self, percentile: float = 99.0, since_ns: int = 0) -> float:
        """Returns how late it woke at most, but for a few times."""
        late = self._late_ns[bisect_left(self._woke_ns, since_ns) :]
        return float(np.percentile(late, percentile)) / 1e6 if late else 0.0

    def slowest_share(self, since_ns: int = 0) -> float:
        """Returns how many of its wakings came in the worst second, as a fraction of all that should."""
        woke = self._woke_ns[bisect_left(self._woke_ns, since_ns) :]
        ends = [bisect_left(woke, begin + NS_PER_S) - k for k, begin in enumerate(woke)]
        whole = [n for n, begin in zip(ends, woke, strict=True) if begin + NS_PER_S <= woke[-1]]
        return min(whole, default=60) / 60

    def close(self) -> None:
        """Ends it."""
        self._ending.set()
        self.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
