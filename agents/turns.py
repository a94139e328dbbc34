"""Who turns an agent's loop: the thread that brings the last of its inputs, or the main thread when it is time.

Waking the main thread for every step would take two changes of thread per hop, about 0.1 ms.
"""

import threading
from collections.abc import Callable

from shared.clock import NS_PER_S, Clock


class Turns:
    """Lets one thread at a time make a turn; who finds it taken leaves the news behind for one more.

    Args:
        turn: One turn of the loop; returns when the next one is due whatever arrives, ns.
        clock: The process's clock.
    """

    def __init__(self, turn: Callable[[], int], clock: Clock) -> None:
        self._turn = turn
        self._clock = clock
        self._taken = threading.Lock()
        self._wanted = False
        self._due_ns = 0
        self._due_earlier = threading.Event()
        self._failure: Exception | None = None

    def take(self) -> None:
        """Makes a turn on the main thread, after one that another thread is making: both hang if that hangs.

        Raises:
            Exception: What ended this turn, or an earlier one on another thread.
        """
        self._due_earlier.clear()
        self._make(patiently=True)
        if self._failure is not None:
            raise self._failure

    def take_aside(self) -> None:
        """Makes a turn on any other thread; the main thread is told what goes wrong."""
        try:
            self._make(patiently=False)
        except Exception as error:  # noqa: BLE001  nobody else would see it: it is raised in `take`
            self._failure = error
            self._due_earlier.set()

    def rest(self, longest_s: float) -> None:
        """Blocks the main thread until a turn is due, at most `longest_s`."""
        left_s = (self._due_ns - self._clock()) / NS_PER_S
        self._due_earlier.wait(min(max(left_s, 0.0), longest_s))

    def end(self) -> None:
        """Waits for a turn that is being made; there is none after it."""
        self._taken.acquire()

    def _make(self, *, patiently: bool) -> None:
        self._wanted = True
        # Looked at again after the release: somebody may have found the turn taken, and gone.
        while self._wanted and self._taken.acquire(blocking=patiently):
            try:
                self._wanted = False
                before, self._due_ns = self._due_ns, self._turn()
                if self._due_ns < before:
                    self._due_earlier.set()
            finally:
                self._taken.release()
