"""Besieges a console: `python -m tests.integration.siege PORT KIND COUNT [USER]`; says `there` once it does.

Kinds: `half-open` (a request that never ends, knocking again whenever it is shown out), `idle-page` (a page
that never reads), `toggling-page` (a page that asks for the hand and withdraws, as fast as it can). It ends
with its standard input.
"""

import asyncio
import concurrent.futures.thread  # noqa: F401  loaded while it can still be read
import contextlib
import os
import resource
import sys
from collections.abc import Awaitable, Callable

HALF = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: "
PAGE = (
    b"GET /ws HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)
TOGGLE = b"".join(
    bytes((0x81, 0x80 | len(text), 0, 0, 0, 0)) + text for text in (b'{"type":"take"}', b'{"type":"release"}')
)
AGAIN_S = 2.0

Knock = Callable[[int], Awaitable[None]]


async def half_open(port: int) -> None:
    """Says half of what it wants, again and again."""
    while True:
        with contextlib.suppress(OSError):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(HALF)
            knocked.release()
            await reader.read()
            writer.close()
        await asyncio.sleep(AGAIN_S)


async def idle_page(port: int) -> None:
    """Opens a page and reads nothing of it."""
    _, writer = await asyncio.open_connection("127.0.0.1", port, limit=1)
    writer.write(PAGE)
    knocked.release()
    await asyncio.sleep(1e6)


async def toggling_page(port: int) -> None:
    """Opens a page that asks for the hand and withdraws."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(PAGE)
    knocked.release()
    swallowing = asyncio.create_task(swallow(reader))
    with contextlib.suppress(OSError):
        while True:
            writer.write(TOGGLE * 100)
            await writer.drain()
    await swallowing


async def swallow(reader: asyncio.StreamReader) -> None:
    with contextlib.suppress(OSError):
        while await reader.read(65_536):
            pass


KINDS: dict[str, Knock] = {"half-open": half_open, "idle-page": idle_page, "toggling-page": toggling_page}
knocked = asyncio.Semaphore(0)


async def main(port: int, kind: str, count: int) -> None:
    """Knocks `count` times at once, and goes on until standard input ends."""
    besiegers = [asyncio.ensure_future(KINDS[kind](port)) for _ in range(count)]
    for _ in range(count):
        await knocked.acquire()
    print("there", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    for besieger in besiegers:
        besieger.cancel()


if __name__ == "__main__":
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    if len(sys.argv) > 4:
        user = int(sys.argv[4])
        os.setgroups([])
        os.setgid(user)
        os.setuid(user)
    asyncio.run(main(int(sys.argv[1]), sys.argv[2], int(sys.argv[3])))
