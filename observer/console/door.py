"""The console's door: lets connections in one by one, knows where they come from, and shows out who loiters.

It stands before the HTTP server, which would keep a connection that says nothing for ever, and one that is
closed but does not read for as long as its system wishes. Who has to go is decided in `observer.console.crowd`.
"""

import asyncio
import logging
import os
import socket
import ssl
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any

from attrs import define

from observer.console.crowd import CLOSING_S, HEADERS_S, Guest, has_stayed_too_long, in_the_way, origin
from observer.console.peer import Peers

SWEEP_S = 0.5
REST_S = 0.1
"""After an attempt to let somebody in that has failed, for want of descriptors for example."""

Client = tuple[str, int]
_Enter = Callable[..., Coroutine[Any, Any, tuple[asyncio.Transport, asyncio.BaseProtocol]]]
_log = logging.getLogger("console")


@define(eq=False)
class _Visit:
    """A guest, and the connection that it came by: on its way in, then inside."""

    guest: Guest
    entering: "asyncio.Task[None] | None" = None
    transport: asyncio.Transport | None = None


class Door:
    """Accepts connections for a server.

    Args:
        listener: Where they come from.
        peers: Tells this machine's users apart; None if whoever comes in has to know a token.
    """

    def __init__(self, listener: socket.socket, peers: Peers | None) -> None:
        self._listener, self._peers = listener, peers
        self._visits: dict[Client, _Visit] = {}
        listener.setblocking(False)

    def guest(self, client: Client | None) -> Guest | None:
        """Returns who has come from an address, None if nobody has."""
        visit = self._visits.get((client[0], client[1])) if client else None
        return visit.guest if visit else None

    async def run(self, make_protocol: Callable[[], asyncio.Protocol], tls: ssl.SSLContext | None) -> None:
        """Lets people in until cancelled.

        Args:
            make_protocol: Makes the server's end of a connection.
            tls: For encrypted ones, else None.
        """
        sweeping = asyncio.create_task(self._sweep())
        enter = partial(
            asyncio.get_running_loop().connect_accepted_socket,
            make_protocol,
            ssl=tls,
            ssl_handshake_timeout=HEADERS_S if tls else None,
            ssl_shutdown_timeout=CLOSING_S if tls else None,
        )
        try:
            await self._let_in(enter)
        finally:
            sweeping.cancel()
            for client in list(self._visits):
                self._show_out(client)

    async def _let_in(self, enter: _Enter) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                connection, address = await loop.sock_accept(self._listener)
            except OSError as error:
                _log.warning("nobody can be let in: %s", error)
                await asyncio.sleep(REST_S)
                continue
            client = (address[0], address[1])
            visit = self._receive(connection, client, loop.time())
            visit.entering = asyncio.create_task(self._hand_over(enter, connection, client, visit))

    def _receive(self, connection: socket.socket, client: Client, now: float) -> _Visit:
        user = self._peers.user(connection) if self._peers else None
        is_stranger = self._peers is not None and self._peers.works and user not in (0, os.getuid())
        newcomer = Guest(origin(client[0], user), now, is_stranger)
        self._show_out(client)  # an earlier one from there is gone, or this one could not be
        in_way = in_the_way([visit.guest for visit in self._visits.values()], newcomer)
        for other in [other for other, visit in self._visits.items() if visit.guest is in_way]:
            self._show_out(other)
        visit = self._visits[client] = _Visit(newcomer)
        return visit

    async def _hand_over(self, enter: _Enter, connection: socket.socket, client: Client, visit: _Visit) -> None:
        try:
            visit.transport, _ = await enter(sock=connection)
        except OSError:  # of TLS, too
            self._forget(client, visit)
        finally:
            visit.entering = None
            if visit.transport is None:
                connection.close()

    async def _sweep(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            await asyncio.sleep(SWEEP_S)
            for client, visit in list(self._visits.items()):
                self._look_after(client, visit, loop.time())

    def _look_after(self, client: Client, visit: _Visit, now: float) -> None:
        guest, transport = visit.guest, visit.transport
        backlog = transport.get_write_buffer_size() if transport else 0
        if transport is not None and transport.is_closing():
            guest.closing_since = now if guest.closing_since is None else guest.closing_since
            if backlog == 0:
                self._forget(client, visit)
                return
        if has_stayed_too_long(guest, now, backlog):
            self._show_out(client)

    def _show_out(self, client: Client) -> None:
        """Ends a connection at once, whatever it has not read yet."""
        visit = self._visits.pop(client, None)
        if visit and visit.entering:
            visit.entering.cancel()
        if visit and visit.transport:
            visit.transport.abort()

    def _forget(self, client: Client, visit: _Visit) -> None:
        if self._visits.get(client) is visit:
            del self._visits[client]
