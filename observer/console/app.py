"""The web application: the page's files, its WebSocket, STOP for those without one, and who is let in."""

import asyncio
import contextlib
import socket
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware import Middleware
from starlette.requests import Request, cookie_parser
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from observer.console.access import is_own_host, is_same_site, is_token
from observer.console.console import Console
from observer.console.crowd import KEPT_S, Guest, Pace, Place, Places
from observer.console.page_link import PageLink

PAGE = Path(__file__).resolve().parent / "page"
LOOK_S = 0.5
"""How often to look whether a page that has a kept place steers."""

_TRY_AGAIN_LATER = 1013
_FULL = "so many pages are open that only one that steers finds room; STOP is heard all the same"
_STRANGER = (
    "this console was started without a token, for one user of this machine: others come in by a token"
    " (--token random)\n"
)

Guests = Callable[[tuple[str, int] | None], Guest | None]
"""Who has come from an address; None if that is not known."""

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-cache",
}
"""Sent with every answer: the page loads nothing from elsewhere and nobody frames it."""


def make_app(console: Console, token: str | None, guests: Guests = lambda _: None) -> Starlette:
    """Makes the application.

    Args:
        console: Whom the pages talk to.
        token: What a page must know, None for whoever is no stranger.
        guests: Who has come in by the door.
    """
    places = Places()

    async def page(websocket: WebSocket) -> None:
        guest = guests(websocket.scope.get("client"))
        with _seated(places, guest) as place:
            await _serve_page(websocket, console, place)

    async def stop(_: Request) -> Response:
        unheard = console.stop()
        return PlainTextResponse(unheard, 503) if unheard else Response(status_code=204)

    return Starlette(
        routes=[
            WebSocketRoute("/ws", page),
            Route("/stop", stop, methods=["POST"]),
            Mount("/", StaticFiles(directory=PAGE, html=True)),
        ],
        middleware=[Middleware(Guard, token=token, guests=guests)],
    )


@contextlib.contextmanager
def _seated(places: Places, guest: Guest | None) -> Iterator[Place | None]:
    place = places.take(guest.origin if guest else "")
    if guest and place:
        guest.is_page = True
    try:
        yield place
    finally:
        if place:
            places.leave(place)


async def _serve_page(websocket: WebSocket, console: Console, place: Place | None) -> None:
    await websocket.accept()
    if place is None:
        await websocket.close(_TRY_AGAIN_LATER, _FULL)
        return
    link = console.open()
    work = [link.run(websocket.send_text), _listen(websocket, console, link)]
    if place.is_kept:
        work.append(_until_idle(console, link))
    tasks = [asyncio.create_task(_until_gone(each)) for each in work]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        console.close(link)
        for task in tasks:
            task.cancel()
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):  # it has gone by itself
        await websocket.close(_TRY_AGAIN_LATER, _FULL)


async def _until_gone(work: Coroutine[Any, Any, None]) -> None:
    with contextlib.suppress(WebSocketDisconnect):
        await work


async def _listen(websocket: WebSocket, console: Console, link: PageLink) -> None:
    loop = asyncio.get_running_loop()
    pace = Pace(loop.time())
    while (message := await websocket.receive())["type"] == "websocket.receive":
        text = message.get("text")
        console.hear(link, message.get("bytes", b"") if text is None else text)
        await asyncio.sleep(pace.wait(loop.time()))


async def _until_idle(console: Console, link: PageLink) -> None:
    """Returns when a page has not steered for `KEPT_S`."""
    loop = asyncio.get_running_loop()
    steered = loop.time()
    while loop.time() - steered < KEPT_S:
        await asyncio.sleep(LOOK_S)
        if console.steers(link):
            steered = loop.time()


class Guard:
    """Refuses with 403 whoever comes through a foreign name, from a foreign site, or without the token.

    Where there is no token, it refuses the other users of this machine.

    The address that the console prints carries the token once; it is answered with a cookie that no script can
    read and no foreign site can use, and the token leaves the address bar.

    Args:
        app: What is guarded.
        token: The token, None for none.
        guests: Who has come in by the door.
    """

    def __init__(self, app: ASGIApp, token: str | None, guests: Guests) -> None:
        self._app = app
        self._token = token
        self._guests = guests
        name = socket.gethostname().lower()
        self._names = {name, name.partition(".")[0]}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on, or answers it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        reason = self._refusal(scope, headers)
        if reason and scope["type"] == "websocket":
            await send({"type": "websocket.close"})  # before it is accepted this answers 403
        elif reason:
            await PlainTextResponse(reason, 403, HEADERS)(scope, receive, send)
        elif self._token and scope["type"] == "http" and _asked_token(scope) is not None:
            await self._welcome(scope, self._token)(scope, receive, send)
        else:
            await self._app(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope, headers: Headers) -> str | None:
        host, guest = headers.get("host", ""), self._guests(scope.get("client"))
        if guest is not None:
            guest.asked = True
        if guest is not None and guest.is_stranger:
            return _STRANGER
        if not is_own_host(host, self._names):
            return f"{host!r:.80} is no name of this machine; open the console by its address or as localhost\n"
        acts = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        if acts and not is_same_site(headers.get("origin"), host):
            return "the console talks to its own page only\n"
        if self._token is not None and not (
            is_token(_cookie(headers, _cookie_name(scope)), self._token)
            or (scope["type"] == "http" and is_token(_asked_token(scope), self._token))
        ):
            return "this console wants its token: open the whole address that it printed when it started\n"
        return None

    def _welcome(self, scope: Scope, token: str) -> RedirectResponse:
        answer = RedirectResponse("/", 303, HEADERS)
        secure = scope["scheme"] == "https"
        answer.set_cookie(_cookie_name(scope), token, httponly=True, samesite="strict", secure=secure)
        return answer


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(scope=message).update(HEADERS)
        await send(message)

    return sending


def _asked_token(scope: Scope) -> str | None:
    given = parse_qs(scope["query_string"].decode("latin-1")).get("token")
    return given[0] if given and scope["path"] == "/" else None


def _cookie_name(scope: Scope) -> str:
    """Cookies do not know ports: two consoles on one machine must not take each other's."""
    server = scope.get("server")
    return f"swarmtouch-{server[1] if server else 0}"


def _cookie(headers: Headers, name: str) -> str | None:
    # The standard library's parser raises at another program's cookie with an unusual name.
    return cookie_parser(headers.get("cookie", "")).get(name)
