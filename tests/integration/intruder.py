"""Foreign Zenoh sessions with certificates of their own, against the nodes of a real flight."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import zenoh

from shared.net.keyring import Keyring
from shared.net.settings import Settings

CONNECT_MS = 3000
PACE_S = 0.01


def client_of(endpoint: str, authority: Keyring, name: str | None, pair: Keyring | None = None) -> Settings:
    """Builds a client that dials one node.

    Args:
        endpoint: The node's.
        authority: Whose certificate it trusts: the swarm's, which is no secret.
        name: Whose certificate it shows; None for none.
        pair: Where that certificate lies, by default with the authority.
    """
    tls: Settings = {"root_ca_certificate": str(authority.authority), "verify_name_on_connect": True}
    if name is not None:
        pair = pair or authority
        tls |= {
            "enable_mtls": True,
            "connect_certificate": str(pair.certificate(name)),
            "connect_private_key": str(pair.key(name)),
        }
    return {
        "mode": "client",
        "connect": {"endpoints": [endpoint], "timeout_ms": CONNECT_MS, "exit_on_failure": True},
        "scouting": {"multicast": {"enabled": False}},
        "transport": {"link": {"tls": tls}},
    }


@contextmanager
def session_of(settings: Settings) -> Iterator[Callable[[str, bytes], None]]:
    """Opens a session; yields a function that puts bytes on a key.

    Raises:
        zenoh.ZError: Nobody lets it in.
    """
    with zenoh.open(zenoh.Config.from_json5(json.dumps(settings))) as session:

        def put(key: str, payload: bytes) -> None:
            session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)

        yield put


def pour(put: Callable[[str, bytes], None], key: str, payload: bytes, *, count: int, rate_hz: float) -> None:
    """Puts one payload again and again, at this rate unless the machine is too busy for it."""
    start, sent = time.monotonic(), 0
    while sent < count:
        due = min(count, int((time.monotonic() - start) * rate_hz) + 1)
        while sent < due:
            put(key, payload)
            sent += 1
        time.sleep(PACE_S)
