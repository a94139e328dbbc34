"""Who is let in where there are keys: members, each with as many links as a node needs, and nobody else."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
import zenoh

from deploy.launcher.ports import free_ports
from deploy.net.authority import create, issue, remove
from shared.bus import ZenohBus
from shared.config import load_scenario
from shared.formation import build_formation
from shared.net.audit import CROWD, MOST_SESSIONS, Audit
from shared.net.keyring import Keyring
from shared.net.settings import node_settings
from shared.nodes import all_nodes, drone_node, endpoint
from shared.topics import DRONE_STATE
from tests.contract.test_bus_contract import DEADLINE_S, Presence, collect, inbox_of
from tests.integration.intruder import client_of, session_of

pytestmark = pytest.mark.timeout(180)
ONE, TWO, THREE = (drone_node(i) for i in (1, 2, 3))


class Members:
    """A swarm of two drones' buses with keys, on free ports of this machine."""

    def __init__(self, folder: Path) -> None:
        self.keys = Keyring(folder / "keys")
        create(self.keys, "rhombus")
        formation = build_formation(load_scenario("rhombus"))
        nodes = all_nodes(formation)
        for node in nodes:
            issue(self.keys, node)
        ports = free_ports(tcp=0, udp=len(nodes))[1]
        where = [
            f'net.endpoints."{node}"=quic/127.0.0.1:{port}?mixed_rel=1'
            for node, port in zip(nodes, ports, strict=True)
        ]
        self.scenario = load_scenario("rhombus", ["net.profile=field", f"net.keys={self.keys.folder}", *where])
        self.formation = formation

    def bus(self, node: str) -> ZenohBus:
        """Opens the bus of a node, with the list of members as it is now."""
        bus = ZenohBus(node_settings(self.scenario, self.formation, node))
        bus.watch_links(Audit(self.keys.members()))
        return bus

    @contextmanager
    def knocking(self, at: str, node: str) -> Iterator[None]:
        """Dials a node with a certificate as often as it likes; raises `ZError` unless it is let in."""
        with session_of(client_of(endpoint(self.scenario, self.formation, at), self.keys, node)):
            yield


@pytest.fixture
def members(tmp_path: Path) -> Members:
    return Members(tmp_path)


def links(bus: ZenohBus) -> dict[str, int]:
    """Returns how many links a bus has with whom."""
    told = bus.audit()
    return {name.removeprefix("linked "): int(n) for name, n in told.items() if name.startswith("linked ")}


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_removed_member_gets_no_link_and_takes_no_place(members: Members) -> None:
    pair = {file: file.read_bytes() for file in (members.keys.certificate(TWO), members.keys.key(TWO))}
    remove(members.keys, TWO)
    for file, content in pair.items():
        file.write_bytes(content)
    with members.bus(ONE) as one, members.bus(THREE):
        until(lambda: THREE in links(one))
        with pytest.raises(zenoh.ZError), members.knocking(ONE, TWO):
            pass
        assert TWO not in links(one)


def test_who_dials_a_removed_member_does_not_link_to_it_either(members: Members) -> None:
    with members.bus(ONE) as removed:
        (members.keys.folder / "members.toml").write_text(f"members = ['{TWO}', '{THREE}']", encoding="utf-8")
        with members.bus(TWO) as two, members.bus(THREE):
            until(lambda: THREE in links(two))
            assert links(two).keys() == {THREE}
            assert links(removed) == {}


def test_a_member_with_a_new_certificate_is_let_in_by_who_runs_already(members: Members) -> None:
    with members.bus(ONE) as one:
        before = members.keys.certificate(TWO).read_bytes()
        issue(members.keys, TWO)
        assert members.keys.certificate(TWO).read_bytes() != before
        with members.bus(TWO):
            until(lambda: TWO in links(one))


def test_a_member_that_takes_more_links_than_it_needs_is_told_of_and_moves_nobody(members: Members) -> None:
    """Zenoh cannot end a link, so this is all; who is linked stays linked."""
    with members.bus(ONE) as one, members.bus(THREE) as three, ExitStack() as crowd:
        inbox, presence = inbox_of(one, DRONE_STATE.key(id=3)), Presence(one)
        three.announce("drone", 3)
        state = three.publisher(DRONE_STATE, id=3)
        presence.until("drone/3")
        for _ in range(MOST_SESSIONS + 1):
            crowd.enter_context(members.knocking(ONE, TWO))
        until(lambda: one.audit().get(f"refused {TWO}, {CROWD}") == 1.0)
        state(b"still here")
        assert collect(inbox, 1) == {DRONE_STATE.key(id=3): [b"still here"]}
