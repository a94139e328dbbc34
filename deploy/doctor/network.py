"""Ports, a real link over the bus, and multicast."""

import math
import socket
import time
from collections.abc import Iterator
from contextlib import closing

from deploy.doctor.finding import Finding, bad, good, warning
from deploy.launcher.ports import free_ports
from observer.console import PORT
from shared.bus import ZenohBus
from shared.clock import Clock, system_clock
from shared.errors import DeviceError
from shared.formation import build_formation
from shared.net.settings import peer_settings
from shared.nodes import LOOPBACK, all_nodes
from shared.radio import Receiver, Transmitter
from shared.radio_link import radio_group
from shared.scenario import Scenario
from shared.topics import FORMATION_STATE, HAND
from shared.transport import Inbox, Publish

LINK_S = 5.0
SLOW_MS = 5.0
_ROUNDS = 50
_NS_PER_MS = 1_000_000
_WAIT_S = 0.5
_SWARM = "doctor"


def check_ports(scenario: Scenario) -> Finding:
    """Looks whether the default ports are free; the launcher takes others, processes started by hand do not."""
    base = scenario.net.base_port
    wanted = [base + k for k in range(len(all_nodes(build_formation(scenario))))] + [PORT]
    taken = [port for port in wanted if not _is_free(port)]
    if taken:
        return warning(
            "ports",
            f"in use: {', '.join(map(str, taken))} of {base} to {wanted[-2]} and {PORT}",
            "swarmtouch up chooses others by itself; by hand set net.base_port, or end what listens there",
        )
    return good("ports", f"{base} to {wanted[-2]} and {PORT} are free")


def check_link() -> Finding:
    """Links two nodes over loopback and measures one way between them."""
    (port,), _ = free_ports(tcp=1, udp=0)
    endpoint = f"tcp/{LOOPBACK}:{port}"
    clock = system_clock()
    inbox = Inbox(clock)
    try:
        with (
            ZenohBus(peer_settings(_SWARM, endpoint)) as one,
            ZenohBus(peer_settings(_SWARM, "", [endpoint])) as other,
        ):
            one.subscribe(FORMATION_STATE.wildcard, inbox)
            publish = other.publisher(FORMATION_STATE)
            deadline = time.monotonic() + LINK_S
            while not inbox.take():
                if time.monotonic() > deadline:
                    return bad("link", f"no message within {LINK_S:.0f} s over {endpoint}", _BLOCKED)
                publish(b"")
                inbox.wait(0.05)
            took = sorted(_one_way_ms(publish, inbox, clock) for _ in range(_ROUNDS))
    except DeviceError as error:
        return bad("link", str(error), _BLOCKED)
    middle = took[_ROUNDS // 2]
    if middle > SLOW_MS:
        return warning("link", f"{middle:.1f} ms one way", "the machine is busy: end what else runs")
    return good("link", f"{middle:.2f} ms one way over {endpoint} (median of {_ROUNDS})")


_BLOCKED = "allow TCP on loopback: look at the firewall, at a VPN or a sandbox"


def check_multicast(scenario: Scenario) -> Finding:
    """Says something to itself on the radio's group; only the network profile `radio` needs it."""
    clock = system_clock()
    inbox = Inbox(clock)
    _, (port,) = free_ports(tcp=0, udp=1)
    group = radio_group(scenario.net)._replace(port=port)
    try:
        with (
            closing(Receiver(group, _SWARM, _SWARM, [HAND.key()], clock)) as receiver,
            Transmitter(group, _SWARM, clock) as transmitter,
        ):
            receiver.subscribe(HAND.key(), inbox)
            transmitter.publisher(HAND)(b"")
            if not inbox.wait(_WAIT_S):
                return warning("multicast", f"does not come through on {group.interface}", _FOR_RADIO)
    except DeviceError as error:
        return warning("multicast", str(error), _FOR_RADIO)
    return good("multicast", f"comes through on {group.interface} ({group.address})")


_FOR_RADIO = "needed for the radio profile only: set net.interface, and allow multicast in the firewall"


def _one_way_ms(publish: Publish, inbox: Inbox, clock: Clock) -> float:
    sent = clock()
    publish(b"")
    if not inbox.wait(1.0):
        return math.inf
    return max(a.arrival_ns - sent for arrivals in inbox.take().values() for a in arrivals) / _NS_PER_MS


def _is_free(port: int) -> bool:
    try:
        with socket.create_server((LOOPBACK, port)):
            return True
    except OSError:
        return False


def all_network(scenario: Scenario) -> Iterator[Finding]:
    """Yields every finding about the network."""
    yield check_ports(scenario)
    yield check_link()
    yield check_multicast(scenario)
