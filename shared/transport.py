"""What a bus is: publish bytes on keys, receive the newest bytes per key, announce presence.

Backends: `shared.bus` (Zenoh), `shared.radio` (multicast, from the relay to everybody) and `shared.memory_bus`
(one process, for simulation and tests).
"""

import contextlib
import threading
from collections.abc import Callable, Collection
from typing import NamedTuple, Protocol, Self

from shared.clock import Clock
from shared.topics import Topic

Publish = Callable[[bytes], None]

PENDING_PER_KEY = 8
"""How many samples of one key an inbox keeps: the newest counts, a few older ones survive garbage."""
MOST_KEYS = 4096
"""How many keys at once, or processes: who hears a wildcard hears whatever keys anybody makes up."""
TOO_MANY = "too-many-keys"
"""By this reason whoever keeps something per key counts what he cannot keep."""


class Arrival(NamedTuple):
    """One payload and when it arrived (receiver's clock)."""

    payload: bytes
    arrival_ns: int


class Inbox:
    """Where a bus thread puts payloads and the loop takes them; decoding is the loop's work.

    Args:
        clock: Stamps arrivals.
        depth: Samples kept per key; when full the oldest is dropped and counted in `dropped`. So is what comes
            on further keys than `MOST_KEYS`.

    Attributes:
        answer: Called on the thread that brings news; wakes the loop unless something else is put there.
    """

    def __init__(self, clock: Clock, depth: int = PENDING_PER_KEY) -> None:
        self._clock = clock
        self._depth = depth
        self._missing: set[str] | None = None
        self._pending: dict[str, list[Arrival]] = {}
        self._lock = threading.Lock()
        # Locked: nothing is there. An Event does the same, but costs several times as much.
        self._empty = threading.Lock()
        self._empty.acquire()
        self.answer: Callable[[], None] = self.wake
        self.dropped = 0

    def put(self, key: str, payload: bytes) -> None:
        """Stores one payload under its key; called by the bus. It is news unless something else is expected."""
        arrival = Arrival(payload, self._clock())
        with self._lock:
            queue = self._pending.get(key)
            if queue is None:
                if len(self._pending) >= MOST_KEYS:
                    self.dropped += 1
                    return
                queue = self._pending[key] = []
            if len(queue) >= self._depth:
                del queue[0]
                self.dropped += 1
            queue.append(arrival)
            news = self._missing is None
            if self._missing and key in self._missing:
                self._missing.remove(key)
                news = not self._missing
        if news:
            self.answer()

    def expect(self, keys: Collection[str]) -> None:
        """From now on it is news once something has come on all of these keys, and never if there are none."""
        with self._lock:
            self._missing = {key for key in keys if key not in self._pending}
            news = bool(keys) and not self._missing
        if news:
            self.answer()

    def take(self) -> dict[str, list[Arrival]]:
        """Returns what has arrived since the last call, per key, oldest first, and empties the inbox."""
        self._empty.acquire(blocking=False)
        with self._lock:
            taken, self._pending = self._pending, {}
        return taken

    def wait(self, timeout_s: float) -> bool:
        """Blocks until something that wakes arrives, at most `timeout_s`; returns whether it did."""
        filled = self._empty.acquire(timeout=max(0.0, timeout_s))
        if filled:
            self.wake()
        return filled

    def wake(self) -> None:
        """Ends a `wait` from another thread or a signal handler."""
        # Released already: something is there, or another thread was faster.
        with contextlib.suppress(RuntimeError):
            self._empty.release()


class Bus(Protocol):
    """One process's connection to the swarm."""

    def publisher(self, topic: Topic, **parts: object) -> Publish:
        """Declares a publication, for example `publisher(DRONE_STATE, id=2)`."""

    def subscribe(self, key_expression: str, inbox: Inbox) -> None:
        """Puts every payload of others whose key matches (`*` is one chunk) into the inbox."""

    def announce(self, role: str, number: int) -> None:
        """Shows this process's presence until `close` (a liveliness token)."""

    def watch_presence(self, on_change: Callable[[str, bool], None]) -> None:
        """Calls `on_change("role/id", present)` for every process that appears or disappears."""

    def audit(self) -> dict[str, float]:
        """Returns what a status tells of the network: who is linked, and how often what or whom was refused."""

    def close(self) -> None:
        """Leaves the swarm; returns in bounded time, may be called twice."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...
