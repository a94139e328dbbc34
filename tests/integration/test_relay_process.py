"""The relay as a process of its own: what it shows to the network, and how it starts and ends."""

import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh

pytestmark = pytest.mark.parallel

ROOT = Path(__file__).resolve().parents[2]
DEADLINE_S = 20.0


def start(*arguments: str) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        (sys.executable, "-P", "-m", "human_relay", "--scenario", "rhombus", *arguments),
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def relay() -> Iterator[tuple["subprocess.Popen[bytes]", zenoh.Session]]:
    """A running relay and a foreign client that declares nothing itself."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    process = start("--set", f'net.endpoints.relay="{endpoint}"', "--set", "net.adminspace=true")
    tree = {
        "mode": "client",
        "connect": {"endpoints": [endpoint], "timeout_ms": int(DEADLINE_S * 1000)},
        "scouting": {"multicast": {"enabled": False}},
    }
    try:
        with zenoh.open(zenoh.Config.from_json5(json.dumps(tree))) as session:
            yield process, session
    finally:
        process.kill()
        process.communicate()


def declared(session: zenoh.Session) -> set[str]:
    """Asks the relay's adminspace what it has declared, as `kind/key`."""
    replies = session.get("@/*/peer/**", timeout=5.0)
    keys = [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]
    return {key.split("/peer/", maxsplit=1)[1] for key in keys if "/peer/" in key}


def test_it_publishes_and_never_listens(
    relay: tuple["subprocess.Popen[bytes]", zenoh.Session],
) -> None:
    process, session = relay
    wanted = {"publisher/rhombus/human/hand", "publisher/rhombus/status/relay/0"}
    deadline = time.monotonic() + DEADLINE_S
    shown = declared(session)
    while not wanted <= shown and time.monotonic() < deadline:
        shown = declared(session)
    assert {key for key in shown if key.startswith("publisher/")} == wanted
    assert "token/rhombus/alive/relay/0" in shown
    assert {key for key in shown if key.startswith(("subscriber/", "queryable/", "querier/"))} == set()
    process.terminate()
    assert process.wait(DEADLINE_S) == 0


def test_a_wrong_hand_is_refused_in_one_line() -> None:
    process = start("--hand", "scripted:waltz", "--set", f"net.base_port={free_port()}")
    _, errors = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 2
    assert errors.decode().splitlines()[-1] == (
        "relay: scripted:waltz: no script 'waltz'; scripts: tour, sweep, eight, hold"
    )
