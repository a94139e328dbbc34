"""Runs one swarm for a while, real or bare, and reads what its processes used: one phase of a measurement."""

import asyncio
import math
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Protocol

from attrs import evolve, frozen

from deploy.bench.flight_ear import FlightEar
from deploy.bench.floor_ear import FloorEar, UdpEar, ZenohEar
from deploy.bench.floor_rows import udp_rows, zenoh_rows
from deploy.bench.usage import Usage, read_usage
from deploy.launcher.ports import free_ports
from deploy.launcher.process_table import ProcessRow, process_table, resolve_scenario
from deploy.launcher.supervisor import Child, Supervisor
from observer.swarm import SCENARIO_FILE
from shared.bus import join
from shared.config import dump_scenario
from shared.errors import SwarmTouchError
from shared.formation import Formation
from shared.nodes import OBSERVER, RELAY, all_nodes
from shared.scenario import Scenario
from shared.scenario_check.checked import leave_checked
from shared.transport import Bus

HAND = "scripted:tour"
WARM_UP_S = 1.0
"""From the moment everybody is at work to the first sample that counts, s."""
READY_S = 12.0
"""When all have announced themselves, they have this long to come to work, and as long again per `READY_DRONES`
drones of the swarm, s."""
READY_DRONES = 16
GRACE_S = 0.5
_PERIOD_S = 0.04

Edit = Callable[[ProcessRow], ProcessRow]
"""Changes a row of the process table before it is started: tests put a slower agent in its place."""


class BenchError(SwarmTouchError):
    """A measurement that could not be made."""


class Ear(Protocol):
    """Listens to a swarm."""

    def drain(self) -> None:
        """Takes what has arrived; called 25 times a second."""

    def hears(self, tokens: Sequence[str]) -> bool:
        """Says whether these processes are there, so that the hand may start."""

    @property
    def is_ready(self) -> bool:
        """Whether everybody is at work."""

    def begin(self) -> None:
        """Forgets what has been counted so far: from now on it counts."""


@frozen(kw_only=True)
class Phase:
    """What was measured from outside.

    Attributes:
        seconds: Length of the measurement.
        usage: Growth over it, by process (`drone/2`).
        ready: Whether everybody was at work when it began.
    """

    seconds: float
    usage: dict[str, Usage]
    ready: bool


def fly(
    scenario: Scenario,
    formation: Formation,
    seconds: float,
    *,
    edit: Edit = lambda row: row,
    recorded_to: Path | None = None,
) -> tuple[FlightEar, Phase]:
    """Flies real agents in the simulated world and measures for a while in mid-flight.

    Args:
        scenario: What flies.
        formation: Its formation.
        seconds: Length of the measurement.
        edit: Changes rows of the process table.
        recorded_to: Where a recorder leaves its trace; None for no recorder.

    Raises:
        BenchError: A process ended.
        DeviceError: The bus cannot be opened.
    """
    tcp_ports, (udp_port,) = free_ports(tcp=len(all_nodes(formation)), udp=1)
    scenario = resolve_scenario(scenario, formation, tcp_ports, udp_port)
    with tempfile.TemporaryDirectory() as folder, _observer(scenario, formation) as bus:
        run_dir = recorded_to or Path(folder)
        file = run_dir / SCENARIO_FILE
        file.write_text(dump_scenario(scenario), encoding="utf-8")
        leave_checked(file, scenario)
        record = recorded_to is not None
        rows = process_table(scenario, formation, file=file, hand=HAND, run_dir=run_dir, record=record)
        ear = FlightEar(bus, formation)
        return ear, _run([edit(row) for row in rows], ear, seconds, len(formation.ids))


def fly_bare_zenoh(
    scenario: Scenario, formation: Formation, sizes: dict[int, int], seconds: float
) -> tuple[FloorEar, Phase]:
    """Runs bare nodes on the same links as the agents; arguments and errors as for `fly`.

    Args:
        scenario: Whose links to use.
        formation: Who refers to whom.
        sizes: Bytes of every node's payload, 0 for the hand.
        seconds: Length of the measurement.
    """
    tcp_ports, (udp_port,) = free_ports(tcp=len(all_nodes(formation)), udp=1)
    scenario = resolve_scenario(scenario, formation, tcp_ports, udp_port)
    with _observer(scenario, formation) as bus:
        ear = ZenohEar(bus, formation)
        return ear, _run(zenoh_rows(scenario, formation, sizes), ear, seconds, len(formation.ids))


def fly_bare_udp(
    scenario: Scenario, formation: Formation, sizes: dict[int, int], seconds: float
) -> tuple[FloorEar, Phase]:
    """Runs bare nodes over UDP sockets; arguments and errors as for `fly_bare_zenoh`."""
    _, (observer, *ports) = free_ports(tcp=0, udp=len(formation.ids) + 2)
    with closing(UdpEar(observer, formation)) as ear:
        rows = udp_rows(scenario, formation, sizes, ports, observer)
        return ear, _run(rows, ear, seconds, len(formation.ids))


def _observer(scenario: Scenario, formation: Formation) -> Bus:
    return join(scenario, formation, OBSERVER)


def _run(rows: Iterable[ProcessRow], ear: Ear, seconds: float, drones: int) -> Phase:
    ready_s = READY_S * (1.0 + drones / READY_DRONES)
    mortal = [evolve(row, restarts=False) for row in rows]
    with tempfile.TemporaryDirectory() as logs:
        return asyncio.run(_measure(mortal, ear, seconds, ready_s, Path(logs)))


async def _measure(rows: Sequence[ProcessRow], ear: Ear, seconds: float, ready_s: float, logs: Path) -> Phase:
    ended: list[Child] = []
    supervisor = Supervisor(logs, lambda child, *_: ended.append(child), is_up=lambda token: ear.hears([token]))

    async def until(done: Callable[[], bool], limit_s: float) -> bool:
        deadline = time.monotonic() + limit_s
        while not done():
            if ended:
                raise BenchError(f"{ended[0].row.name} ended: {_last_line(logs, ended[0])}")
            if time.monotonic() >= deadline:
                return False
            await asyncio.sleep(_PERIOD_S)
            ear.drain()
        return True

    try:
        for row in rows:
            if row.role != RELAY:
                supervisor.start(row)
        await until(lambda: not supervisor.awaited, math.inf)
        if missing := supervisor.missing:
            raise BenchError(f"no sign of {', '.join(missing)}; close what else runs here")
        for row in rows:
            if row.role == RELAY:
                supervisor.start(row)
        ready = await until(lambda: ear.is_ready, ready_s)
        await until(lambda: False, WARM_UP_S)
        ear.begin()
        before, started = _usage(supervisor), time.monotonic()
        await until(lambda: False, seconds)
        after, lasted = _usage(supervisor), time.monotonic() - started
    finally:
        await supervisor.stop(GRACE_S)
    growth = {token: after[token].since(before[token]) for token in after}
    return Phase(seconds=lasted, usage=growth, ready=ready)


def _usage(supervisor: Supervisor) -> dict[str, Usage]:
    return {
        token: read_usage(child.process.pid)
        for token, child in supervisor.children.items()
        if child.process is not None
    }


def _last_line(logs: Path, child: Child) -> str:
    lines = (logs / f"{child.row.name}.log").read_text(encoding="utf-8", errors="replace").splitlines()
    return lines[-1] if lines else "it left no message"
