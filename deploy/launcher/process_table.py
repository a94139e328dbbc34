"""The process table: one row per process of a flight, derived from the scenario."""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs
from attrs import frozen

from shared.formation import Formation
from shared.nodes import BRIDGE, CONSOLE, DRONE, OBSERVER, RELAY, WORLD, all_nodes, loopback
from shared.radio_link import GROUP
from shared.scenario import Scenario
from shared.vehicles import vehicle_settings


@frozen(kw_only=True)
class GloveChoice:
    """What the operator wears.

    Attributes:
        uri: URI of the glove.
        patterns: Name or file of the pattern set.
    """

    uri: str
    patterns: str


@frozen(kw_only=True)
class ConsoleChoice:
    """The page in the browser.

    Attributes:
        port: TCP port on loopback.
        pattern_file: Where the frames of the glove's patterns lie.
        takeover: URI of the pointer by which a page may take the hand over from another source; None where the
            hand is a pointer anyway.
    """

    port: int
    pattern_file: Path
    takeover: str | None


@frozen(kw_only=True)
class ProcessRow:
    """One process.

    Attributes:
        role: Role as in its liveliness token.
        number: Number within the role, 0 for single ones.
        command: Command line.
        restarts: Whether it is started again when it ends without being asked to.
        takes_orders: Whether it reads the operator's orders, line by line, from its standard input.
    """

    role: str
    number: int
    command: tuple[str, ...]
    restarts: bool = True
    takes_orders: bool = False

    @property
    def token(self) -> str:
        """What it announces itself as, for example `drone/2`."""
        return f"{self.role}/{self.number}"

    @property
    def name(self) -> str:
        """Its name for people and files, for example `drone-2`."""
        return f"{self.role}-{self.number}" if self.number else self.role


def process_table(
    scenario: Scenario,
    formation: Formation,
    *,
    file: Path,
    hand: str,
    run_dir: Path,
    glove: GloveChoice | None = None,
    record: bool = False,
    console: ConsoleChoice | None = None,
    verbose: bool = False,
) -> tuple[ProcessRow, ...]:
    """Derives the processes of a flight on this machine, in the order in which they start.

    Args:
        scenario: The resolved scenario.
        formation: Its formation.
        file: Where the resolved scenario lies.
        hand: URI of the hand source.
        run_dir: Directory of this run.
        glove: What the operator wears, None for nothing.
        record: Whether everything is recorded.
        console: The page in the browser, None for none.
        verbose: Whether the processes log debugging details.

    Returns:
        The recorder (if there is one), the world (if a vehicle is simulated), one agent per drone, the bridge
        to the glove and the console (if there are any), and the relay last: a hand may only begin to move when
        everybody hears.
    """
    common = ("--scenario", str(file), *(("-v",) if verbose else ()))
    agents = tuple(
        ProcessRow(role=DRONE, number=i, command=_python("agents", *common, "--id", str(i)))
        for i in formation.ids
    )
    world = ProcessRow(
        role=WORLD, number=0, command=_python("agents.vehicles.world", *common, "--run-dir", str(run_dir))
    )
    takeover = ("--takeover", console.takeover) if console and console.takeover else ()
    relay = ProcessRow(
        role=RELAY,
        number=0,
        command=_python("human_relay", *common, "--hand", hand, *takeover),
        takes_orders=True,
    )
    worn = ("--glove", glove.uri, "--patterns", glove.patterns) if glove else ()
    bridge = ProcessRow(role=BRIDGE, number=0, command=_python("glove_bridge", *common, *worn))
    recorder = ProcessRow(
        role=OBSERVER, number=0, command=_python("observer", *common, "--run-dir", str(run_dir))
    )
    simulated = any((vehicle_settings(scenario, i).uri or "").startswith("sim:") for i in formation.ids)
    watchers = (recorder,) if record else ()
    page = (_console_row(console, common),) if console else ()
    bodies = (world,) if simulated else ()
    return (*watchers, *bodies, *agents, *((bridge,) if glove else ()), *page, relay)


def resolve_scenario(
    scenario: Scenario,
    formation: Formation,
    tcp_ports: Sequence[int],
    udp_port: int,
    pointer: str = "",
) -> Scenario:
    """Fills in the addresses that the scenario leaves open.

    Args:
        scenario: The scenario as loaded.
        formation: Its formation.
        tcp_ports: A free port on loopback for every node of `all_nodes(formation)`.
        udp_port: A free port on loopback for the simulated world.
        pointer: Socket of the relay's pointer, empty if it has none.

    Returns:
        The scenario with an endpoint for every node and an address for the vehicles; what it names stays.
    """
    nodes = zip(all_nodes(formation), tcp_ports, strict=True)
    free = {node: loopback(scenario.net, port) for node, port in nodes}
    everyone = scenario.vehicles.all
    multicast = scenario.net.multicast
    if scenario.net.profile == "radio" and not multicast:
        # The number is free: on a radio the relay, first of all nodes, listens on no port of its own.
        multicast = f"{GROUP}:{tcp_ports[0]}"
    uri = everyone.uri or f"sim://127.0.0.1:{udp_port}/{{id}}"
    return attrs.evolve(
        scenario,
        net=attrs.evolve(
            scenario.net,
            endpoints={} if scenario.net.router else {**free, **scenario.net.endpoints},
            multicast=multicast,
            pointer=pointer,
        ),
        vehicles=attrs.evolve(scenario.vehicles, all=attrs.evolve(everyone, uri=uri)),
    )


def hint_overrides(hints: Mapping[str, Any]) -> list[str]:
    """Turns what a hand source knows about its mapping into `--set` items.

    Args:
        hints: Dotted scenario keys and their values.

    Returns:
        `key=value` items for `load_scenario`.
    """
    return [f"{key}={_toml(value)}" for key, value in hints.items()]


def _console_row(console: ConsoleChoice, common: tuple[str, ...]) -> ProcessRow:
    where = ("--port", str(console.port), "--patterns", str(console.pattern_file))
    return ProcessRow(role=CONSOLE, number=0, command=_python("observer.console", *common, *where))


def _toml(value: Any) -> str:
    """Writes a value inline; what is not a table or list looks the same in JSON."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value)


def _python(module: str, *arguments: str) -> tuple[str, ...]:
    # -P: a folder `agents` in the user's working directory must not shadow ours.
    return (sys.executable, "-P", "-m", module, *arguments)
