"""What the links under a Zenoh bus must do when the network does not."""

import json
import os
import socket
import stat
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress

import zenoh

from agents.near_links import NearLinks
from deploy.launcher.ports import free_ports
from shared.bus import ZenohBus, join, reach
from shared.config import load_scenario
from shared.formation import build_formation
from shared.net.settings import OPEN_TIMEOUT_MS, peer_settings
from shared.nodes import dials, drone_node, endpoint
from shared.topics import DRONE_STATE, HAND
from shared.transport import Inbox
from tests.contract.test_bus_contract import DEADLINE_S, collect, inbox_of, link


@contextmanager
def datagram_peer(*dialled: str, listen: str = "") -> Iterator[zenoh.Session]:
    with zenoh.open(zenoh.Config.from_json5(json.dumps(peer_settings("swarm", listen, dialled)))) as session:
        yield session


def test_over_udp_what_must_not_be_lost_goes_by_tcp() -> None:
    (port,) = free_ports(tcp=1, udp=0)[0]
    where = f"udp/127.0.0.1:{port}"
    with datagram_peer(listen=where), datagram_peer(where) as dialling:

        def linked() -> dict[str, zenoh.Reliability | None]:
            return {str(link.dst).partition("/")[0]: link.reliability for link in dialling.info.links()}

        both = {"tcp": zenoh.Reliability.RELIABLE, "udp": zenoh.Reliability.BEST_EFFORT}
        wait_for(lambda: linked() == both)


def test_a_node_hears_although_every_datagram_of_its_joining_is_lost() -> None:
    (port,) = free_ports(tcp=1, udp=0)[0]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as abyss:
        abyss.bind(("127.0.0.1", port))
        with (
            ZenohBus(peer_settings("swarm", f"tcp/127.0.0.1:{port}")) as sender,
            ZenohBus(peer_settings("swarm", "", [f"udp/127.0.0.1:{port}"])) as receiver,
        ):
            inbox = inbox_of(receiver, HAND.key())
            link(sender, receiver)
            sender.publisher(HAND)(b"heard")
            assert collect(inbox, 1) == {HAND.key(): [b"heard"]}
        abyss.setblocking(False)
        assert abyss.recv(65_536), "it was tried by datagram"


def test_no_tcp_link_is_closed_with_a_wait() -> None:
    """Zenoh sets SO_LINGER, and would hold up living links while it closes a dead one."""
    (port,) = free_ports(tcp=1, udp=0)[0]
    where = f"tcp/127.0.0.1:{port}"
    with ZenohBus(peer_settings("swarm", where)), ZenohBus(peer_settings("swarm", "", [where])):
        wait_for(lambda: lingers(port) == [0, 0])


def test_closing_does_not_wait_for_somebody_who_does_not_answer() -> None:
    (port,) = free_ports(tcp=1, udp=0)[0]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", port))
        bus = ZenohBus(peer_settings("swarm", "", [f"udp/127.0.0.1:{port}"]))
        assert silent.recv(65_536), "it is being dialled"
        start = time.monotonic()
        bus.close()
        assert time.monotonic() - start < OPEN_TIMEOUT_MS / 1000


def test_who_comes_near_is_heard_without_a_link_in_the_mesh() -> None:
    ports = free_ports(tcp=2, udp=0)[0]
    ends = (19, 20)  # of the two arms
    where = [f"net.endpoints.drone/{n}=tcp/127.0.0.1:{port}" for n, port in zip(ends, ports, strict=True)]
    scenario = load_scenario("vee", ["formation.n=20", *where])
    formation = build_formation(scenario)
    own, other = map(drone_node, ends)
    assert endpoint(scenario, formation, own) not in dials(scenario, formation, other)
    with join(scenario, formation, own) as here, join(scenario, formation, other) as there:
        inbox, publish = Inbox(time.monotonic_ns), there.publisher(DRONE_STATE, id=20)
        in_mesh = inbox_of(here, DRONE_STATE.key(id=20))

        def heard(wanted: frozenset[int]) -> bool:
            links.follow(wanted)
            publish(b"here")
            return bool(inbox.take())

        links = NearLinks(
            lambda _: reach(scenario, formation, own, other), inbox, time.monotonic_ns, ThreadPoolExecutor(1)
        )
        assert not heard(frozenset())
        wait_for(lambda: heard(frozenset({20})))
        wait_for(lambda: not heard(frozenset()))
        links.close()
        assert in_mesh.take() == {}


def lingers(port: int) -> list[int]:
    """Returns SO_LINGER, 0 is off, of this process's ends of the connections with a port."""
    found = []
    for name in os.listdir("/dev/fd"):
        with suppress(OSError):
            if stat.S_ISSOCK(os.fstat(int(name)).st_mode):
                with socket.socket(fileno=os.dup(int(name))) as end:
                    if port in (end.getsockname()[1], end.getpeername()[1]):
                        found.append(end.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER))
    return found


def wait_for(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)
