"""A flight in namespaces, and what one fault did to it as the recorder and the referee saw it."""

import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import attrs

from deploy.launcher.process_table import ProcessRow
from deploy.net.authority import create, issue
from shared.clock import NS_PER_S
from shared.config import load_scenario
from shared.formation import Formation, build_formation
from shared.net.keyring import Keyring
from shared.nodes import BRIDGE, CONSOLE, OBSERVER, all_nodes
from shared.scenario import Net, Profile, Scenario
from tests.chaos.lab import Lab
from tests.integration.recorder import START_S, Recorder
from tests.integration.swarm import Swarm

ROOT = Path(__file__).resolve().parents[2]
ROUTER = "router"
GUEST = "guest"
"""Node of whoever does not belong."""
OBSERVERS = (f"{OBSERVER}/0", f"{CONSOLE}/0")
PORT, WORLD_PORT = 7447, 7400
PROFILES: dict[str, Profile] = {"quic": "field", "radio": "radio"}
ANYWHERE = "0.0.0.0"  # noqa: S104  in a namespace that nothing outside reaches


class Witness(Recorder):
    """A recorder that notes when somebody's presence appeared or vanished."""

    def __init__(self, scenario: Scenario) -> None:
        self.presence: list[tuple[int, str, bool]] = []
        super().__init__(scenario)

    def _presence_changed(self, token: str, present: bool) -> None:
        self.presence.append((self.clock(), token, present))
        super()._presence_changed(token, present)

    def forget(self, seconds: float) -> None:
        """Drops what is older: a long flight must not fill the memory of its witness."""
        oldest_ns = self.clock() - round(seconds * NS_PER_S)
        self.hands = {key: hand for key, hand in self.hands.items() if hand.stamp_ns >= oldest_ns}
        self.states = {
            drone: [state for state in states if state.step_ns >= oldest_ns] or states[-1:]
            for drone, states in self.states.items()
        }
        self.presence = [event for event in self.presence if event[0] >= oldest_ns]
        self._known = {(s.id, s.epoch, s.seq) for states in self.states.values() for s in states}


class ChaosFlight(Swarm):
    """A swarm of real processes, each in a namespace of its own.

    Args:
        lab: The namespaces; they have been made for the nodes of this scenario.
        scenario: Name of the scenario.
        hand: URI of the hand.
        folder: Where logs go.
        protocol: `tcp`, `udp` or `quic` between the nodes; `quic` is the profile `field`, with keys; `radio` is
            the same, with the hand on the air.
        routed: Whether everybody is the client of a router.
        overrides: `key=value` items.
    """

    recorder: Witness

    def __init__(
        self,
        lab: Lab,
        scenario: str,
        hand: str,
        folder: Path,
        *,
        protocol: str = "tcp",
        routed: bool = False,
        overrides: Sequence[str] = (),
    ) -> None:
        self.lab = lab
        self.folder = folder
        self._profile = PROFILES.get(protocol, "laptop")
        self._protocol = "quic" if protocol == "radio" else protocol
        self._keyring = Keyring(folder / "keys")
        self._routed = routed
        super().__init__(scenario, hand, folder, overrides)
        self.nodes = all_nodes(self.formation)
        common = ("--scenario", str(folder / "scenario.toml"))
        self.add(BRIDGE, "glove_bridge", *common, "--glove", f"record://{folder / 'glove.jsonl'}")

    def place(self, raw: Scenario, formation: Formation) -> Scenario:
        """See `Swarm.place`: everybody in the mesh, vehicles in the air."""
        nodes = all_nodes(formation)
        keys = self._protocol == "quic"
        if keys:
            self._issue_keys(raw.swarm.name, nodes)
        # Clients of a router dial nobody else.
        met = [] if self._routed else nodes
        net = Net(
            profile=self._profile,
            interface="mesh" if self._profile == "radio" else "lo",
            keys=str(self._keyring.folder) if keys else "",
            endpoints={node: self._endpoint(self.lab.mesh(node)) for node in met},
            router=self._endpoint(self.lab.mesh(ROUTER)) if self._routed else None,
        )
        vehicle = attrs.evolve(raw.vehicles.all, uri=f"sim://{self.lab.air('world')}:{WORLD_PORT}/{{id}}")
        return attrs.evolve(raw, net=net, vehicles=attrs.evolve(raw.vehicles, all=vehicle))

    def open_recorder(self) -> Witness:
        """See `Swarm.open_recorder`: through the air; where there is a router it has to be there first."""
        if self._routed:
            self.start(self.add(ROUTER, "deploy.router", "--listen", self._endpoint(ANYWHERE)))
        net = self.scenario.net
        endpoints = {node: self._endpoint(self.lab.air(node)) for node in net.endpoints}
        router = self._endpoint(self.lab.air(ROUTER)) if self._routed else None
        # The hand's radio is in the mesh, where the recorder is not: it hears no hand.
        net = attrs.evolve(net, interface="lo", endpoints=endpoints, router=router)
        return Witness(attrs.evolve(self.scenario, net=net))

    def command(self, row: ProcessRow) -> tuple[str, ...]:
        """See `Swarm.command`: in its namespace, where it listens on the mesh and in the air."""
        node = row.token if row.role == "drone" else row.role
        placed = node == ROUTER or node in all_nodes(self.formation)
        met = node in self.scenario.net.endpoints
        listen = ("--set", f"net.endpoints.{node}={self._endpoint(ANYWHERE)}") if met else ()
        return (*self.lab.within(node if placed else OBSERVER), *row.command, *listen)

    def add(self, role: str, module: str, *arguments: str) -> str:
        """Adds a process to the swarm; returns its token."""
        row = ProcessRow(role=role, number=0, command=(sys.executable, "-P", "-m", module, *arguments))
        self._rows[row.token] = row
        return row.token

    def replace(self, token: str, *command: str) -> None:
        """Gives a process another command line, for its next start."""
        self._rows[token] = attrs.evolve(self._rows[token], command=command)

    def command_of(self, token: str) -> tuple[str, ...]:
        """Returns the command line of a process."""
        return self._rows[token].command

    def run_as(self, node: str, module: str, *arguments: str) -> str:
        """Runs a module to its end as some node, listening meanwhile; returns what it printed."""
        command = (*self.lab.within(node), sys.executable, "-m", module, *arguments)
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
            self.recorder.until(lambda: process.poll() is not None, START_S)
            return process.communicate()[0].strip()

    def start_all(self) -> None:
        """See `Swarm.start_all`; the router is there already and has no presence.

        Observers have one, but do not link to each other: the recorder, one of them, cannot see it.
        """
        members = set(self._rows) - {"relay/0", f"{ROUTER}/0"}
        for token in members:
            self.start(token)
        seen = members - set(OBSERVERS)
        self.recorder.until(lambda: seen <= self.recorder.present, START_S)
        self.start("relay/0")

    def _issue_keys(self, swarm: str, nodes: Sequence[str]) -> None:
        create(self._keyring, swarm)
        for node in nodes:
            issue(self._keyring, node, (self.lab.mesh(node), self.lab.air(node)))

    def _endpoint(self, address: str) -> str:
        # Best effort as datagrams, what is reliable as streams.
        return f"{self._protocol}/{address}:{PORT}{'?mixed_rel=1' if self._protocol == 'quic' else ''}"


@contextmanager
def chaos_flight(
    folder: Path,
    hand: str = "scripted:tour?peak=0.4",
    scenario: str = "rhombus",
    *,
    emulated: bool = False,
    protocol: str = "tcp",
    routed: bool = False,
    overrides: Sequence[str] = (),
    before: Callable[["ChaosFlight"], object] = lambda _: None,
) -> Iterator[ChaosFlight]:
    """Makes a lab and a flight in it that follows the hand, and removes both for sure.

    Args:
        folder: Where logs go.
        hand: URI of the hand.
        scenario: Name of the scenario.
        emulated: See `Lab`.
        protocol: See `ChaosFlight`.
        routed: See `ChaosFlight`.
        overrides: `key=value` items.
        before: Changes the flight before it starts.
    """
    folder.mkdir(parents=True, exist_ok=True)
    nodes = all_nodes(build_formation(load_scenario(scenario, overrides)))
    with Lab([*nodes, ROUTER, GUEST], emulated=emulated) as lab:
        flight = ChaosFlight(lab, scenario, hand, folder, protocol=protocol, routed=routed, overrides=overrides)
        try:
            before(flight)
            flight.fly()
            flight.recorder.listen(1.0)
            yield flight
        finally:
            flight.close()
