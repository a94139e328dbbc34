"""The web application: the page's files, its WebSocket, and who is let in."""

import asyncio
import contextlib
import socket
from pathlib import Path
from urllib.parse import parse_qs

from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware import Middleware
from starlette.requests import cookie_parser
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.routing import Mount, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from observer.console.access import is_own_host, is_same_site, is_token
from observer.console.console import Console
from observer.console.page_link import PageLink

PAGE = Path(__file__).resolve().parent / "page"
MOST_PAGES = 32
_TRY_AGAIN_LATER = 1013

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


def make_app(console: Console, token: str | None) -> Starlette:
    """Makes the application.

    Args:
        console: Whom the pages talk to.
        token: What a page must know, None for everybody who can reach this machine's loopback.
    """

    async def page(websocket: WebSocket) -> None:
        await _serve_page(websocket, console)

    return Starlette(
        routes=[WebSocketRoute("/ws", page), Mount("/", StaticFiles(directory=PAGE, html=True))],
        middleware=[Middleware(Guard, token=token)],
    )


async def _serve_page(websocket: WebSocket, console: Console) -> None:
    await websocket.accept()
    if console.pages >= MOST_PAGES:
        await websocket.close(_TRY_AGAIN_LATER, "too many pages are open")
        return
    link = console.open()
    tasks = [
        asyncio.create_task(_tell(websocket, link)),
        asyncio.create_task(_listen(websocket, console, link)),
    ]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        console.close(link)
        for task in tasks:
            task.cancel()


async def _tell(websocket: WebSocket, link: PageLink) -> None:
    with contextlib.suppress(WebSocketDisconnect):
        await link.run(websocket.send_text)
        await websocket.close(_TRY_AGAIN_LATER, "this page does not read what it is told")


async def _listen(websocket: WebSocket, console: Console, link: PageLink) -> None:
    while (message := await websocket.receive())["type"] == "websocket.receive":
        text = message.get("text")
        console.hear(link, message.get("bytes", b"") if text is None else text)


class Guard:
    """Refuses with 403 whoever comes through a foreign name, from a foreign site, or without the token.

    The address that the console prints carries the token once; it is answered with a cookie that no script can
    read and no foreign site can use, and the token leaves the address bar.

    Args:
        app: What is guarded.
        token: The token, None for none.
    """

    def __init__(self, app: ASGIApp, token: str | None) -> None:
        self._app = app
        self._token = token
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
        host = headers.get("host", "")
        if not is_own_host(host, self._names):
            return f"{host!r:.80} is no name of this machine; open the console by its address or as localhost\n"
        if scope["type"] == "websocket" and not is_same_site(headers.get("origin"), host):
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
