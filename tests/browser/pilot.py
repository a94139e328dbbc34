"""Somebody at the page: sees what the page is told, and moves mouse and keys."""

import json
import time
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

from playwright.sync_api import Browser, ConsoleMessage, Request, WebSocket

Json = dict[str, Any]
PATIENCE_S = 20.0

_TO_SCREEN = """async ([fence, point]) => {
    const { TopCamera } = await import("./view/camera.js");
    const box = document.getElementById("surface").getBoundingClientRect();
    const [x, y] = new TopCamera(fence, box.width, box.height).toScreen(point);
    return [box.left + x, box.top + y];
}"""


class Pilot:
    """One page in a browser context of its own.

    Args:
        browser: Where it is opened.
        url: Its address.
        init_script: JavaScript that runs before the page's.
        options: For the context: `viewport`, `color_scheme`, `has_touch`, ...

    Attributes:
        page: The page itself.
        errors: What the page has logged as an error or thrown.
        hosts: Every host that it has asked for something.
        patterns: The pattern messages, in order.
    """

    def __init__(self, browser: Browser, url: str, *, init_script: str = "", **options: Any) -> None:
        self.errors: list[str] = []
        self.hosts: set[str] = set()
        self.patterns: list[Json] = []
        self._told: dict[str, Json] = {}
        viewport = {"width": 1440, "height": 900}
        self._context = browser.new_context(**{"viewport": viewport, "color_scheme": "dark", **options})
        self._context.add_init_script(init_script)
        self.page = self._context.new_page()
        self.page.on("console", self._logged)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", self._asked)
        self.page.on("websocket", self._connected)
        self.page.goto(url)

    def told(self, kind: str) -> Json:
        """Returns the newest message of a kind, waiting for the first."""
        self.until(lambda: kind in self._told)
        return self._told[kind]

    def until(self, condition: Callable[[], object], limit_s: float = PATIENCE_S) -> None:
        """Lets the page go on until a condition holds."""
        deadline = time.monotonic() + limit_s
        while not condition():
            assert time.monotonic() < deadline, f"not within {limit_s} s: {self.text('#hand')}"
            self.page.wait_for_timeout(20)

    def text(self, selector: str) -> str:
        """Returns the text of an element."""
        return self.page.inner_text(selector)

    def press(self, name: str) -> None:
        """Presses the button of this name."""
        self.page.get_by_role("button", name=name).click()

    def take_off(self) -> None:
        """Flies, once every drone is heard and nobody holds the hand; waits until all follow.

        As a person does it presses again if the hand is lost on the way: a browser that gets no time for 0.6 s
        falls silent.
        """
        self.until(lambda: not any(word in self.text("#swarm-state") for word in ("silent", "connect")))
        self.until(lambda: self.text("#take") == "Take the hand")

        def follows() -> bool:
            if self.text("#take") == "Take the hand":
                self.page.click("#fly")
            return self.all_in("FOLLOW")

        self.until(follows)

    def until_mode(self, mode: str) -> None:
        """Waits until the page is told that every drone is in a mode."""
        self.until(lambda: self.all_in(mode))

    def all_in(self, mode: str) -> bool:
        """Says whether the page has been told that every drone is in a mode."""
        count = len(self.told("scene")["drones"])
        return [d["mode"] for d in self.told("snapshot")["drones"]] == [mode] * count

    def hand(self) -> list[float]:
        """Returns the mapped hand as the page is told."""
        point: list[float] = self.told("snapshot")["hand"]["point"]
        return point

    def spot(self, point: list[float]) -> tuple[float, float]:
        """Returns where a point of the world is on the screen."""
        x, y = self.page.evaluate(_TO_SCREEN, [self.told("scene")["fence"], point])
        return x, y

    def drag_hand(self, x: float, y: float) -> None:
        """Drags the hand to a place of the world with the mouse, m."""
        mouse = self.page.mouse
        mouse.move(*self.spot(self.hand()))
        mouse.down()
        mouse.move(*self.spot([x, y, 0.0]), steps=8)
        mouse.up()

    def close(self) -> None:
        """Closes the page and its context."""
        self._context.close()

    def _logged(self, message: ConsoleMessage) -> None:
        if message.type == "error":
            self.errors.append(message.text)

    def _asked(self, request: Request) -> None:
        self.hosts.add(urlsplit(request.url).hostname or request.url)

    def _connected(self, socket: WebSocket) -> None:
        self.hosts.add(urlsplit(socket.url).hostname or socket.url)
        socket.on("framereceived", self._received)

    def _received(self, payload: str | bytes) -> None:
        message = json.loads(payload)
        self._told[message["type"]] = message
        if message["type"] == "pattern":
            self.patterns.append(message)
