"""The bus over Eclipse Zenoh; the only file that imports zenoh.

Topology: peers with static links, no discovery: every node listens on its endpoint and dials the endpoints it
is given (each pair is dialled once, by the node that comes later in `shared.nodes`). The facts behind the
settings are measured: links found by gossip never heal after a partition, one rx worker stalls healthy peers
when another vanishes, TCP presence is seen within milliseconds.
"""

import json
import logging
import os
import threading
from collections.abc import Callable, Sequence
from typing import Any, Self

# Read once when the library loads: with a single rx worker, a peer that vanishes silently stalls the others.
os.environ.setdefault("ZENOH_RUNTIME", "(rx: (worker_threads: 8))")

import zenoh

from shared.errors import DeviceError
from shared.topics import ALIVE, Delivery, Topic
from shared.transport import Inbox, Publish

CLOSE_TIMEOUT_S = 2.0
"""Closing may hang during a partition; after this long the process ends without it."""

_LEASE_MS = 1000
_OTHERS = zenoh.Locality.REMOTE
_log = logging.getLogger("bus")
_QOS: dict[Delivery, dict[str, Any]] = {
    Delivery.STATE: {
        "reliability": zenoh.Reliability.BEST_EFFORT,
        "congestion_control": zenoh.CongestionControl.DROP,
        "priority": zenoh.Priority.REAL_TIME,
        "express": True,
    },
    Delivery.EVENT: {
        "reliability": zenoh.Reliability.RELIABLE,
        "congestion_control": zenoh.CongestionControl.DROP,
        "priority": zenoh.Priority.DATA,
        "express": False,
    },
}


class ZenohBus:
    """One Zenoh session; see `shared.transport.Bus`.

    Args:
        namespace: Name of the swarm, prefix of every key.
        listen: Own endpoint, empty to listen nowhere.
        connect: Endpoints to dial, again and again until they answer.
        adminspace: Whether to answer adminspace queries.

    Raises:
        DeviceError: The endpoint cannot be listened on.
    """

    def __init__(
        self, namespace: str, listen: str, connect: Sequence[str] = (), *, adminspace: bool = False
    ) -> None:
        try:
            self._session = zenoh.open(_settings(namespace, listen, connect, adminspace))
        except zenoh.ZError as error:
            raise DeviceError(
                f"cannot open the bus at {listen or 'no endpoint'}: {error}. Is the port in use? Set"
                " net.endpoints or net.base_port"
            ) from error
        self._declared: list[Any] = []

    def publisher(self, topic: Topic, **parts: object) -> Publish:
        """See `Bus.publisher`."""
        declared = self._session.declare_publisher(topic.key(**parts), **_QOS[topic.delivery])
        self._declared.append(declared)
        return declared.put

    def subscribe(self, key_expression: str, inbox: Inbox) -> None:
        """See `Bus.subscribe`; the callback only stores bytes, decoding is the loop's work."""

        def store(sample: zenoh.Sample) -> None:
            inbox.put(str(sample.key_expr), sample.payload.to_bytes())

        # On Zenoh's own thread: handing over to a Python thread per subscription would cost a wake-up each.
        handler = zenoh.handlers.Callback(store, indirect=False)
        self._declared.append(self._session.declare_subscriber(key_expression, handler, allowed_origin=_OTHERS))

    def announce(self, role: str, number: int) -> None:
        """See `Bus.announce`."""
        token = self._session.liveliness().declare_token(ALIVE.format(role=role, id=number))
        self._declared.append(token)

    def watch_presence(self, on_change: Callable[[str, bool], None]) -> None:
        """See `Bus.watch_presence`."""
        prefix = ALIVE.split("{", maxsplit=1)[0]

        def changed(sample: zenoh.Sample) -> None:
            on_change(str(sample.key_expr).removeprefix(prefix), sample.kind == zenoh.SampleKind.PUT)

        watcher = self._session.liveliness().declare_subscriber(f"{prefix}**", changed, history=True)
        self._declared.append(watcher)

    def close(self) -> None:
        """See `Bus.close`; ends the process if the library does not return."""
        watchdog = threading.Timer(CLOSE_TIMEOUT_S, _give_up)
        watchdog.daemon = True
        watchdog.start()
        for declared in self._declared:
            declared.undeclare()
        self._declared.clear()
        self._session.close()  # type: ignore[no-untyped-call]  # the stub lacks its return type
        watchdog.cancel()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _give_up() -> None:
    _log.error("the bus did not close within %.1f s; ending without it", CLOSE_TIMEOUT_S)
    logging.shutdown()
    os._exit(1)


def _settings(namespace: str, listen: str, connect: Sequence[str], adminspace: bool) -> zenoh.Config:
    # A swarm's processes start together and in any order: who was too early asks again soon.
    retry = {"period_init_ms": 100, "period_max_ms": 250, "period_increase_factor": 1.5}
    tree = {
        "mode": "peer",
        "namespace": namespace,
        "listen": {"endpoints": [listen] if listen else [], "exit_on_failure": True},
        "connect": {
            "endpoints": list(connect),
            "timeout_ms": -1,
            "exit_on_failure": False,
            "retry": retry,
        },
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "adminspace": {"enabled": adminspace, "permissions": {"read": True, "write": False}},
        "transport": {
            "link": {"tx": {"lease": _LEASE_MS, "keep_alive": 4}},
            "shared_memory": {"enabled": False},
        },
    }
    return zenoh.Config.from_json5(json.dumps(tree))
