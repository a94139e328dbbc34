"""One open page: what waits to be sent to it, and the task that sends it.

Events wait in order; of snapshots only the newest counts, so a slow page gets fewer, never older ones.
"""

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable

MOST_EVENTS = 256
"""A page that leaves so many unread has stopped reading."""

Send = Callable[[str], Awaitable[None]]


class PageLink:
    """Queue of one page.

    Args:
        number: Of the page, for people and other pages.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        self._events: deque[str] = deque()
        self._snapshot: str | None = None
        self._filled = asyncio.Event()
        self._lost = False

    def tell(self, event: str) -> None:
        """Queues a message that must arrive."""
        self._lost = self._lost or len(self._events) >= MOST_EVENTS
        if not self._lost:
            self._events.append(event)
        self._filled.set()

    def show(self, snapshot: str) -> None:
        """Offers the newest snapshot; one that is still unsent is replaced."""
        self._snapshot = snapshot
        self._filled.set()

    async def run(self, send: Send) -> None:
        """Sends until it is cancelled, the connection breaks, or the page has stopped reading."""
        while not self._lost:
            await self._filled.wait()
            self._filled.clear()
            while self._events:
                await send(self._events.popleft())
            snapshot, self._snapshot = self._snapshot, None
            if snapshot is not None:
                await send(snapshot)
