"""A page without a browser: what a WebSocket client of the console sees and does."""

import contextlib
import json
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, Self

from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.sync.client import ClientConnection, connect

OPEN_S = 20.0
REPEAT_S = 0.05


class Page:
    """One open page; listens on a thread of its own and, while told to, repeats its hand as a browser does.

    Attributes:
        newest: Newest message of each type.
        counts: How many messages of each type have come.
    """

    def __init__(self, connection: ClientConnection) -> None:
        self.newest: dict[str, dict[str, Any]] = {}
        self.counts: Counter[str] = Counter()
        self._connection = connection
        self._point: list[float] | None = None
        self._closed = threading.Event()
        self._threads = [threading.Thread(target=work) for work in (self._listen, self._repeat)]
        for thread in self._threads:
            thread.start()

    def say(self, **message: object) -> None:
        """Sends one message."""
        self._connection.send(json.dumps(message))

    def point(self, x: float, y: float, z: float = 1.2) -> None:
        """Points somewhere, now and repeatedly."""
        self._point = [x, y, z]
        self.say(type="hand", point=self._point, yaw=0.0)

    def until(self, condition: Callable[[], object], limit_s: float) -> float:
        """Waits until it holds; returns how long that took, s."""
        start = time.monotonic()
        while not condition():
            assert time.monotonic() - start < limit_s, f"not within {limit_s} s: {self.newest.get('control')}"
            time.sleep(0.005)
        return time.monotonic() - start

    @property
    def modes(self) -> set[str]:
        """Modes of the drones, as the page sees them."""
        return {drone["mode"] for drone in self.newest.get("snapshot", {}).get("drones", ())}

    @property
    def closed(self) -> bool:
        """Whether the connection is gone."""
        return self._closed.is_set()

    def close(self) -> None:
        """Closes the page."""
        self._connection.close()
        for thread in self._threads:
            thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _listen(self) -> None:
        try:
            for text in self._connection:
                message = json.loads(text)
                self.newest[message["type"]] = message
                self.counts[message["type"]] += 1
        except ConnectionClosed:
            pass
        finally:
            self._closed.set()

    def _repeat(self) -> None:
        while not self._closed.wait(REPEAT_S):
            point = self._point
            if point is not None:
                with contextlib.suppress(ConnectionClosed):
                    self.say(type="hand", point=point, yaw=0.0)


@contextlib.contextmanager
def open_page(port: int, limit_s: float = OPEN_S, token: str = "") -> Iterator[Page]:
    """Opens a page as soon as the console lets it in, trying again as a browser does; closes it for sure.

    Args:
        port: Of the console.
        limit_s: How long to try, s.
        token: What the console wants to know; a browser has it in a cookie.
    """
    deadline = time.monotonic() + limit_s
    while True:
        with contextlib.ExitStack() as stack:
            page = _try_page(port, stack, {"Cookie": f"swarmtouch-{port}={token}"} if token else {})
            if page is not None:
                yield page
                return
        assert time.monotonic() < deadline, f"the console on port {port} lets nobody in within {limit_s} s"
        time.sleep(0.05)


def _try_page(port: int, stack: contextlib.ExitStack, headers: dict[str, str]) -> Page | None:
    """Opens a page that lives as long as the stack; None if it is not let in, or told to go again."""
    try:
        address = f"ws://127.0.0.1:{port}/ws"
        connection = stack.enter_context(connect(address, compression=None, additional_headers=headers))
    except (OSError, WebSocketException, EOFError):
        return None
    page = stack.enter_context(Page(connection))
    page.until(lambda: "snapshot" in page.newest or page.closed, OPEN_S)
    return None if page.closed else page
