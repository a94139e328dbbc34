"""Runs the console: binds its address, joins the swarm, serves pages until told to stop."""

import asyncio
import contextlib
import logging
import os
import secrets
import socket
import threading
from collections.abc import AsyncIterator, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import uvicorn
from attrs import frozen
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from observer.console import PORT
from observer.console.access import is_loopback
from observer.console.app import make_app
from observer.console.arguments import RANDOM_TOKEN, TOKEN_VARIABLE
from observer.console.console import Console, run
from observer.console.door import Door
from observer.console.pattern_file import NO_PATTERNS, Patterns, read_patterns
from observer.console.peer import Peers
from observer.console.protocol import MAX_MESSAGE
from observer.console.scene import HandMap
from observer.console.swarm_view import SwarmView
from observer.console.tls import certificate
from observer.swarm import open_observer
from shared.clock import system_clock
from shared.errors import ConfigError, DeviceError
from shared.files import read_text
from shared.formation import build_formation
from shared.nodes import LOOPBACK
from shared.private_socket import PrivateSender
from shared.process import LAUNCHER_PID
from shared.scenario import Scenario
from shared.transport import Inbox

SHORTEST_TOKEN = 8
_DEPTH = 64
_PING_S = 5.0
_LONGEST_HEAD = 16_384
_BACKLOG = 64
_TOKEN_HINT = f"this system does not tell them apart; --token {RANDOM_TOKEN} does"


@frozen(kw_only=True)
class Options:
    """How to serve.

    Attributes:
        scenario: The resolved scenario of the swarm.
        patterns: Pattern file, None without.
        host: Address to bind.
        port: TCP port, 0 for any free one.
        token: `random`, or `@FILE` that holds one; None takes the environment's, if it has one.
        tls: Folder of a certificate, which is made if it is not there; None for plain HTTP.
    """

    scenario: Scenario
    patterns: Path | None = None
    host: str = LOOPBACK
    port: int = PORT
    token: str | None = None
    tls: Path | None = None


def serve(options: Options, stopping: threading.Event) -> None:
    """Serves until SIGTERM, SIGINT or `stopping`.

    Raises:
        ConfigError: The address wants a token, or a file is refused.
        DeviceError: The address is in use.
    """
    token = find_token(options.token)
    if token is None and not is_loopback(options.host):
        raise ConfigError(
            f"--host {options.host}: whoever reaches this address could fly; give --token {RANDOM_TOKEN},"
            f" --token @FILE or {TOKEN_VARIABLE}"
        )
    pair = certificate(options.tls, options.host) if options.tls else None
    patterns = read_patterns(options.patterns) if options.patterns else NO_PATTERNS
    with (
        _listening(options.host, options.port) as listener,
        contextlib.closing(PrivateSender(options.scenario.net.pointer)) as pointer,
    ):
        # Answered on standard output for people and for programs that start a console.
        # Under a launcher that is a log file, and logs keep no secrets.
        shown = None if LAUNCHER_PID in os.environ else token
        print(f"console | {_address(options, listener, shown)}", flush=True)
        asyncio.run(_serve(options, patterns, listener, pointer, token, pair, stopping))


def find_token(choice: str | None) -> str | None:
    """Returns the token.

    Args:
        choice: `random`, `@FILE`, or None for the environment variable. A token itself is refused: every user
            of the machine can read command lines.

    Raises:
        ConfigError: The choice is none of these, or the token is too short.
    """
    if choice == RANDOM_TOKEN:
        return secrets.token_urlsafe(16)
    if choice is None:
        token = os.environ.get(TOKEN_VARIABLE)
    elif choice.startswith("@"):
        try:
            token = read_text(Path(choice[1:])).strip()
        except (OSError, ValueError) as error:
            raise ConfigError(f"--token {choice}: {error}") from error
    else:
        raise ConfigError(f"--token: expected {RANDOM_TOKEN} or @FILE; others can read command lines")
    if token is not None and not (len(token) >= SHORTEST_TOKEN and token.isascii() and token.isprintable()):
        raise ConfigError(f"the console's token must be at least {SHORTEST_TOKEN} printable ASCII characters")
    return token


async def _serve(
    options: Options,
    patterns: Patterns,
    listener: socket.socket,
    pointer: PrivateSender,
    token: str | None,
    pair: tuple[Path, Path] | None,
    stopping: threading.Event,
) -> None:
    clock, scenario = system_clock(), options.scenario
    formation = build_formation(scenario)
    hand = HandMap(scenario, formation)
    view = SwarmView(formation, hand, patterns.frames, patterns.cues, clock())
    console = Console(
        scenario,
        formation,
        view=view,
        hand=hand,
        point=pointer.send,
        sender=secrets.randbits(64),
        clock=clock,
    )
    inbox = Inbox(clock, _DEPTH)
    with open_observer(scenario) as bus:
        for key in view.keys:
            bus.subscribe(key, inbox)
        bus.watch_presence(view.presence_changed)
        async with _open_to_pages(console, listener, token, pair, stopping):
            await run(console, bus, inbox, clock, stopping)


@contextlib.asynccontextmanager
async def _open_to_pages(
    console: Console,
    listener: socket.socket,
    token: str | None,
    pair: tuple[Path, Path] | None,
    stopping: threading.Event,
) -> AsyncIterator[None]:
    """Serves pages meanwhile; whatever ends the server ends the console."""
    peers = None if token else Peers()
    if peers and not peers.works:
        print(f"console | all users of this machine may come in: {_TOKEN_HINT}", flush=True)
    door = Door(listener, peers)
    logging.getLogger("asyncio").addFilter(is_news)
    config = _config(make_app(console, token, door.guest), pair)
    config.load()
    server = uvicorn.Server(config)
    protocol = partial(H11Protocol, config=config, server_state=server.server_state, app_state={})
    serving = asyncio.create_task(server.serve(sockets=[]))
    letting_in = asyncio.create_task(door.run(protocol, config.ssl))
    for task in (serving, letting_in):
        task.add_done_callback(lambda _: stopping.set())
    try:
        yield
    finally:
        server.should_exit = True
        await serving
        letting_in.cancel()
        if peers:
            peers.close()


def _config(app: ASGIApp, pair: tuple[Path, Path] | None) -> uvicorn.Config:
    tls: dict[str, Any] = {"ssl_certfile": pair[0], "ssl_keyfile": pair[1]} if pair else {}
    return uvicorn.Config(
        app,
        lifespan="off",
        http=H11Protocol,
        ws="websockets-sansio",
        log_config=None,
        log_level=logging.WARNING,
        access_log=False,
        server_header=False,
        h11_max_incomplete_event_size=_LONGEST_HEAD,
        ws_max_size=8 * MAX_MESSAGE,
        ws_ping_interval=_PING_S,
        ws_ping_timeout=_PING_S,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=1,
        **tls,
    )


def is_news(record: logging.LogRecord) -> bool:
    """Says whether a line of asyncio's log is worth one: it has one for each write to a page that has gone."""
    return record.msg != "socket.send() raised exception."


@contextlib.contextmanager
def _listening(host: str, port: int) -> Iterator[socket.socket]:
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        listener = socket.create_server((host, port), family=family, backlog=_BACKLOG)
    except OSError as error:
        raise DeviceError(f"console: cannot listen on {host}:{port}: {error}; choose another --port") from error
    with listener:
        yield listener


def _address(options: Options, listener: socket.socket, token: str | None) -> str:
    host, port = listener.getsockname()[:2]
    shown = socket.gethostname() if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host  # noqa: S104  compared, not bound
    scheme = "https" if options.tls else "http"
    return f"{scheme}://{shown}:{port}/{f'?token={token}' if token else ''}"
