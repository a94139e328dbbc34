"""A network of namespaces on one machine: one per process, two interfaces each.

`mesh` is the swarm's network, the one that faults hit; `air` stands for the vehicles' own radio, and for the
recorder's way in, by which it hears every node whatever happens to the mesh.
"""

import fcntl
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Self

import attrs

from tests.chaos.weather import Weather

PREFIX = "chaos-"
SWITCH = f"{PREFIX}switch"
UPLINK = "chaos-up"
LOCK = "/run/chaos.lock"
MESH, AIR = "10.77.0", "10.78.0"
INSTALL = "apt-get install iproute2 iptables"


def obstacle() -> str | None:
    """Returns why no namespaces can be made here and what to do, None if they can."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    if not (shutil.which("ip") and shutil.which("iptables")):
        return f"no ip or iptables; {INSTALL}"
    made = subprocess.run(
        ["/usr/bin/env", "ip", "netns", "add", f"{PREFIX}try"], check=False, capture_output=True
    )
    if made.returncode:
        return f"no network namespaces: {made.stderr.decode().strip()}"
    _run("ip", "netns", "del", f"{PREFIX}try")
    return None


def _run(*command: str) -> str:
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, f"{' '.join(command)}: {done.stderr}"
    return done.stdout


def _sweep() -> None:
    # A namespace goes when the kernel gets round to it, and its end of the cable with it: do not wait.
    if Path(f"/sys/class/net/{UPLINK}").exists():
        _run("ip", "link", "del", UPLINK)
    for space in Path("/run/netns").glob(f"{PREFIX}*"):
        _run("ip", "netns", "del", space.name)


class Lab:
    """The namespaces of one flight.

    Args:
        nodes: Names as in `shared.nodes`, and of whoever else takes part.
        emulated: Whether the mesh is the emulator's, whose weather can be set, or a plain switch.
    """

    def __init__(self, nodes: Sequence[str], *, emulated: bool = False) -> None:
        self._number = {node: 10 + index for index, node in enumerate(nodes)}
        self._emulator: subprocess.Popen[str] | None = None
        # One lab at a time on a machine: the names of its namespaces and the addresses in them are fixed.
        self._alone = open(LOCK, "ab")  # noqa: SIM115  held until the lab is closed
        fcntl.flock(self._alone, fcntl.LOCK_EX)
        _sweep()  # what an earlier run that was killed has left
        try:
            self._build_air()
            if emulated:
                self._start_emulator()
            else:
                self._build_mesh()
        except BaseException:
            self.close()
            raise

    def mesh(self, node: str) -> str:
        """Returns the address of a node in the swarm's network."""
        return f"{MESH}.{self._number[node]}"

    def air(self, node: str) -> str:
        """Returns the address by which its vehicle, and the recorder, reach a node."""
        return f"{AIR}.{self._number[node]}"

    def within(self, node: str) -> tuple[str, ...]:
        """Returns what to put before a command that runs as a node; it keeps its process number."""
        return ("ip", "netns", "exec", _space(node))

    def part(self, some: Iterable[str], others: Iterable[str]) -> None:
        """Lets nothing pass between two groups of nodes in the mesh."""
        others = tuple(others)
        for one in some:
            for other in others:
                self._drop(one, "--source", self.mesh(other))
                self._drop(other, "--source", self.mesh(one))

    def lose(self, probability: float) -> None:
        """Loses packets at every node of the mesh as they come in."""
        for node in self._number:
            chance = ("--match", "statistic", "--mode", "random", "--probability", str(probability))
            self._drop(node, "--in-interface", "mesh", *chance)

    def deafen(self, node: str) -> None:
        """Lets nothing come in at a node, nor go out to it, in the mesh and in the air; it may speak."""
        self._drop(node)
        for other in self._number:
            for address in (self.mesh(node), self.air(node)):
                if other != node:
                    self._drop(other, "--destination", address, chain="OUTPUT")

    def taken_in(self, node: str) -> int:
        """Returns how many IPv4 packets the kernel of a node has handed on to whoever they were for."""
        table = _run(*self.within(node), "grep", "^Ip:", "/proc/net/snmp")
        names, values = (line.split() for line in table.splitlines())
        return int(values[names.index("InDelivers")])

    def silence(self, listener: str, speaker: str) -> None:
        """Lets nothing of the speaker reach the listener through the air."""
        self._drop(listener, "--source", self.air(speaker))

    def heal(self) -> None:
        """Undoes `part`, `lose`, `deafen` and `silence`."""
        for node in self._number:
            _run(*self.within(node), "iptables", "--flush")

    def weather(self, weather: Weather) -> None:
        """Sets the weather of every link of an emulated mesh."""
        assert self._emulator is not None
        assert self._emulator.stdin is not None
        print(json.dumps(attrs.asdict(weather)), file=self._emulator.stdin, flush=True)

    def close(self) -> None:
        """Removes everything; may be called twice."""
        if self._alone.closed:
            return
        if self._emulator is not None:
            with suppress(OSError):
                self._emulator.communicate(timeout=5.0)
        _sweep()
        self._alone.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _build_air(self) -> None:
        _run("ip", "netns", "add", SWITCH)
        for bridge in ("air", "mesh"):
            _run("ip", "-n", SWITCH, "link", "add", bridge, "type", "bridge")
            _run("ip", "-n", SWITCH, "link", "set", bridge, "up")
        for node in self._number:
            _run("ip", "netns", "add", _space(node))
            _run("ip", "-n", _space(node), "link", "set", "lo", "up")
            self._plug(node, "air", self.air(node))
        _run("ip", "link", "add", UPLINK, "type", "veth", "peer", "name", "uplink", "netns", SWITCH)
        _run("ip", "-n", SWITCH, "link", "set", "uplink", "master", "air", "up")
        _run("ip", "address", "add", f"{AIR}.1/24", "dev", UPLINK)
        _run("ip", "link", "set", UPLINK, "up")

    def _build_mesh(self) -> None:
        for node in self._number:
            self._plug(node, "mesh", self.mesh(node))

    def _plug(self, node: str, bridge: str, address: str) -> None:
        port = f"{bridge}{self._number[node]}"
        _run(
            "ip",
            "-n",
            SWITCH,
            "link",
            "add",
            port,
            "type",
            "veth",
            "peer",
            "name",
            bridge,
            "netns",
            _space(node),
        )
        _run("ip", "-n", SWITCH, "link", "set", port, "master", bridge, "up")
        self._name(node, bridge, address)

    def _name(self, node: str, interface: str, address: str) -> None:
        _run("ip", "-n", _space(node), "address", "add", f"{address}/24", "dev", interface)
        _run("ip", "-n", _space(node), "link", "set", interface, "up")

    def _start_emulator(self) -> None:
        places = [f"{_space(node)}={self.mesh(node)}" for node in self._number]
        self._emulator = subprocess.Popen(
            [sys.executable, "-m", "tests.chaos.emulator", "mesh", *places],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=Path(__file__).resolve().parents[2],
        )
        assert self._emulator.stdout is not None
        assert self._emulator.stdout.readline() == "ready\n", "the emulator did not start"
        for node in self._number:
            self._name(node, "mesh", self.mesh(node))

    def _drop(self, node: str, *match: str, chain: str = "INPUT") -> None:
        _run(*self.within(node), "iptables", "--append", chain, *match, "--jump", "DROP")


def _space(node: str) -> str:
    return PREFIX + node.replace("/", "-")
