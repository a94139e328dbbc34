"""The bus over Eclipse Zenoh; the only file that imports zenoh.

Topology: peers with static links, no discovery: every node listens on its endpoint and dials the endpoints it
is given (each pair is dialled once, by the node that comes later in `shared.nodes`); `shared.net` says how.
"""

import ctypes
import json
import logging
import os
import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

# Read once when the library loads. With a single rx worker, a peer that vanishes silently stalls the others.
# Links live where they were opened, in net or acc: unless rx is the same, each message wakes two threads.
os.environ.setdefault(
    "ZENOH_RUNTIME",
    "(rx: (worker_threads: 8), net: (handover: rx), acc: (handover: rx), tx: (worker_threads: 2))",
)

import zenoh

from shared.clock import system_clock
from shared.errors import DecodeError, DeviceError
from shared.formation import Formation
from shared.net.access import presence, writes
from shared.net.audit import LOG_FILTER, REFUSED, Audit
from shared.net.keyring import Keyring
from shared.net.linger import stop_lingering
from shared.net.log_tap import tap_stdout
from shared.net.settings import Settings, node_settings, router_settings
from shared.nodes import RELAY
from shared.radio import Receiver, Transmitter
from shared.radio_link import radio_group
from shared.scenario import Scenario
from shared.topics import ALIVE, Delivery, Topic, parse_presence
from shared.transport import MOST_KEYS, Bus, Inbox, Publish

CLOSE_TIMEOUT_S = 1.0
"""Closing waits for every attempt to dial somebody who is not there; after this long it is left to itself."""

_OTHERS = zenoh.Locality.REMOTE
_ALIVE_PREFIX = ALIVE.split("{", maxsplit=1)[0]
_known = threading.local()
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
    """One process's Zenoh session, and the radio that it listens to beside it; see `shared.transport.Bus`.

    Args:
        settings: Configuration of the session, see `shared.net.settings`.
        radio: Where the hand is on the air: it is subscribed to as well, and closed with the bus.

    Raises:
        DeviceError: An endpoint cannot be listened on, or no router answers (later it may vanish and return).
    """

    def __init__(self, settings: Settings, radio: Receiver | None = None) -> None:
        self._declared: list[Any] = []
        self._radio = radio
        self._audit: Audit | None = None
        self._foreign_tokens = 0
        try:
            self._session = _open(settings)
        except DeviceError:
            if radio:
                radio.close()
            raise
        self._declared.append(_let_dead_links_go(self._session))

    def watch_links(self, audit: Audit) -> None:
        """Tells an audit of every link, and of what Zenoh refuses on it.

        Zenoh's log is set up once per process: call it before anybody else does.
        """
        self._audit = audit

        def changed(event: zenoh.LinkEvent) -> None:
            identity, name = str(event.link.zid), event.link.auth_identifier
            audit.linked(identity, name, present=event.kind == zenoh.SampleKind.PUT)

        listener = self._session.info.declare_link_events_listener(changed, history=True)
        self._declared.append(listener)

    def audit(self) -> dict[str, float]:
        """See `Bus.audit`."""
        told = self._audit.metrics() if self._audit else {}
        if self._radio:
            told |= self._radio.audit()
        if self._foreign_tokens:
            told[f"{REFUSED}tokens of no process"] = float(self._foreign_tokens)
        return told

    def publisher(self, topic: Topic, **parts: object) -> Publish:
        """See `Bus.publisher`."""
        declared = self._session.declare_publisher(topic.key(**parts), **_QOS[topic.delivery])
        self._declared.append(declared)
        return declared.put

    def subscribe(self, key_expression: str, inbox: Inbox) -> None:
        """See `Bus.subscribe`; the callback stores bytes, what else it does is up to the inbox."""

        def store(sample: zenoh.Sample) -> None:
            _stay_known()
            # The key that it was put on, be it `**`: whoever takes it judges the key like the payload.
            inbox.put(str(sample.key_expr), sample.payload.to_bytes())

        # On Zenoh's own thread: handing over to a Python thread per subscription would cost a wake-up each.
        handler = zenoh.handlers.Callback(store, indirect=False)
        subscriber = self._session.declare_subscriber(key_expression, handler, allowed_origin=_OTHERS)
        self._declared.append(subscriber)
        if self._radio:
            self._radio.subscribe(key_expression, inbox)

    def announce(self, role: str, number: int) -> None:
        """See `Bus.announce`."""
        token = self._session.liveliness().declare_token(ALIVE.format(role=role, id=number))
        self._declared.append(token)

    def watch_presence(self, on_change: Callable[[str, bool], None]) -> None:
        """See `Bus.watch_presence`."""
        here: set[str] = set()

        def changed(sample: zenoh.Sample) -> None:
            present = sample.kind == zenoh.SampleKind.PUT
            try:
                token = parse_presence(str(sample.key_expr))
            except DecodeError:
                self._foreign_tokens += present
                return
            if present and len(here) >= MOST_KEYS and token not in here:
                self._foreign_tokens += 1
            elif present or token in here:
                (here.add if present else here.discard)(token)
                on_change(token, present)

        watcher = self._session.liveliness().declare_subscriber(f"{_ALIVE_PREFIX}**", changed, history=True)
        self._declared.append(watcher)
        if self._radio:
            self._radio.watch_presence(on_change)

    def close(self) -> None:
        """See `Bus.close`; goes on without the library if that does not return."""
        leaving = threading.Thread(target=self._leave, name="close", daemon=True)
        leaving.start()
        leaving.join(CLOSE_TIMEOUT_S)
        if leaving.is_alive():
            _log.info("the bus is still closing after %.1f s; going on without it", CLOSE_TIMEOUT_S)
        if self._radio:
            self._radio.close()

    def _leave(self) -> None:
        for declared in self._declared:
            declared.undeclare()
        self._declared.clear()
        self._session.close()  # type: ignore[no-untyped-call]  # the stub lacks its return type

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def join(
    scenario: Scenario, formation: Formation, node: str, *, listening: bool = True, audited: bool = False
) -> Bus:
    """Joins the swarm as one of its nodes.

    Args:
        scenario: The scenario; `net` says how.
        formation: Its formation.
        node: Name of the node (`shared.nodes`).
        listening: False for a node that nobody dials, as any number of observers are.
        audited: Whether to count and log whom the access rules refuse; it takes standard output over, so it
            is for processes that do not talk to a terminal.

    Raises:
        ConfigError: The profile wants keys that are not there, or has no group to speak in.
        DeviceError: The endpoint cannot be listened on, or the radio's interface is not there.
    """
    if scenario.net.profile == "radio" and node == RELAY:
        return Transmitter(radio_group(scenario.net), scenario.swarm.name, system_clock())
    settings = node_settings(scenario, formation, node, listening=listening)
    if not (scenario.net.keys and audited):
        return ZenohBus(settings, _hand_on_air(scenario))
    audit = Audit(Keyring(Path(scenario.net.keys)).members())
    _listen_to_zenoh(audit)
    bus = ZenohBus(settings, _hand_on_air(scenario))
    bus.watch_links(audit)
    return bus


def reach(scenario: Scenario, formation: Formation, node: str, other: str) -> Bus:
    """Opens a second session of a node that hears one other node, beside the links that it always has.

    Args:
        scenario: The scenario; `net` says how.
        formation: Its formation.
        node: Name of the node (`shared.nodes`).
        other: Name of the other.

    Raises:
        ConfigError: As for `join`.
        DeviceError: There is a router, and it does not answer.
    """
    return ZenohBus(node_settings(scenario, formation, node, only=other))


def _hand_on_air(scenario: Scenario) -> Receiver | None:
    """Begins to listen to the relay where its profile puts it on the air, and to nobody else there."""
    if scenario.net.profile != "radio":
        return None
    (token,) = presence(RELAY)
    speaker = token.removeprefix(_ALIVE_PREFIX)
    return Receiver(radio_group(scenario.net), scenario.swarm.name, speaker, writes(RELAY), system_clock())


def _listen_to_zenoh(audit: Audit) -> None:
    clock = system_clock()

    def on_log(text: str) -> None:
        audit.read(text)
        if report := audit.report(clock()):
            _log.warning("refused: %s", report)

    tap_stdout(on_log)
    zenoh.init_log_from_env_or(LOG_FILTER)


@contextmanager
def routing(listen: str) -> Iterator[None]:
    """Forwards everything between the clients that dial this endpoint, of all swarms, while it is entered.

    Args:
        listen: Endpoint of the router.

    Raises:
        DeviceError: The endpoint cannot be listened on.
    """
    session = _open(router_settings(listen))
    watching = _let_dead_links_go(session)
    try:
        yield
    finally:
        watching.undeclare()  # type: ignore[no-untyped-call]  # the stub lacks its return type
        session.close()  # type: ignore[no-untyped-call]  # as above


def _reason(error: zenoh.ZError) -> str:
    """Returns what Zenoh says, without the places in its sources at which it says so."""
    return re.sub(r"\.? at [^\s\]]+\.rs:\d+\.*", "", str(error)).strip(" .")


def _open(settings: Settings) -> zenoh.Session:
    try:
        return zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))
    except zenoh.ZError as error:
        if settings["mode"] == "client":
            raise DeviceError(f"no router: {_reason(error)}. Does one run where net.router says?") from error
        where = ", ".join(settings["listen"]["endpoints"]) or "no endpoint"
        raise DeviceError(
            f"cannot open the bus at {where}: {_reason(error)}. Is the port in use? Set net.endpoints or"
            " net.base_port"
        ) from error


def _stay_known() -> None:
    """Keeps what Python knows of the calling thread of Zenoh's, which ends with the process.

    Else Python would forget it after each callback and make it anew for the next: pages mapped and unmapped, on
    every processor, per sample.
    """
    if not hasattr(_known, "state"):
        _known.state = ctypes.pythonapi.PyGILState_Ensure()


def _let_dead_links_go(session: zenoh.Session) -> "zenoh.LinkEventsListener[None]":
    def changed(event: zenoh.LinkEvent) -> None:
        if event.kind == zenoh.SampleKind.PUT:
            stop_lingering()

    handler = zenoh.handlers.Callback(changed, indirect=False)
    return session.info.declare_link_events_listener(handler, history=True)
