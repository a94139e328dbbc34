"""One open page: what waits to be sent to it, and the task that sends it.

Events wait in order; of everything that describes how things are (`control`, `notices`, `health`, `snapshot`)
only the newest counts. So a slow page gets less, never older news, and of events that it does not read the
oldest are dropped: whatever others do, it is not closed for it.
"""

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable

MOST_EVENTS = 64

Send = Callable[[str], Awaitable[None]]


class PageLink:
    """Queue of one page.

    Args:
        number: Of the page, for people and other pages.
        greeting: Sent before everything else.
    """

    def __init__(self, number: int, greeting: str) -> None:
        self.number = number
        self._greeting = greeting
        self._events: deque[str] = deque(maxlen=MOST_EVENTS)
        self._states: dict[str, str] = {}
        self._filled = asyncio.Event()

    def tell(self, event: str) -> None:
        """Queues a message about something that has happened."""
        self._events.append(event)
        self._filled.set()

    def show(self, kind: str, state: str) -> None:
        """Offers the newest message of a kind; one that is still unsent is replaced."""
        self._states[kind] = state
        self._filled.set()

    async def run(self, send: Send) -> None:
        """Sends until it is cancelled or the connection breaks."""
        if self._greeting:
            await send(self._greeting)
            self._greeting = ""
        while True:
            await self._filled.wait()
            self._filled.clear()
            while self._events:
                await send(self._events.popleft())
            states, self._states = self._states, {}
            for state in states.values():
                await send(state)
