"""`bench start`: from `swarmtouch up` to the first formation-wide step, and what that time is made of.

The flight is the real command in a process of its own. The bench watches for its ports from outside and then
listens from the place of the glove bridge, which every swarm has a link for. In turns with the starts it runs
the same number of processes that only import what the agents and the world import, at the same time: so much of
the wait is Python.
"""

import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from attrs import frozen

from deploy.bench.figures import TEXT_COLUMNS, spread
from deploy.bench.report import INK, Report, Sheet
from deploy.bench.swarm import BenchError
from deploy.launcher.monitor import Monitor
from observer.flight_stats import FlightStats
from observer.swarm import LATEST, SCENARIO_FILE
from shared.bus import join
from shared.clock import NS_PER_S, Clock, system_clock
from shared.config import load_scenario
from shared.errors import ConfigError
from shared.formation import Formation, build_formation
from shared.messages import DroneState, HandSample
from shared.nodes import BRIDGE, RELAY, WORLD, drone_node, endpoint
from shared.scenario import Scenario

LIMIT_S = 60.0
END_S = 10.0
_PERIOD_S = 0.004
_SOCKETS = Path("/proc/net/tcp")
_LISTEN = "0A"

PARTS = {
    "launcher_s": "launcher: imports, scenario, ports",
    "members_s": "world and agents: imports, until all listen",
    "relay_s": "their links seen by the launcher; relay: imports, until it listens",
    "step_s": "links to the relay, first sample, every hop",
}


@frozen(kw_only=True)
class Start:
    """One start, s: the parts one after the other, and beside them what importing alone takes."""

    launcher_s: float
    members_s: float
    relay_s: float
    step_s: float
    imports_s: float

    @property
    def total_s(self) -> float:
        """From the command to the first formation-wide step."""
        return self.launcher_s + self.members_s + self.relay_s + self.step_s


class FirstSteps(FlightStats):
    """Notes when each drone first made a set-point that contains a hand sample through every hop.

    Attributes:
        first_ns: By drone, the stamp of that state.
    """

    def __init__(self, formation: Formation) -> None:
        super().__init__(formation)
        self.first_ns: dict[int, int] = {}
        self._order = {formation.ids[row]: depth for depth, rows in enumerate(formation.levels) for row in rows}

    def update(self, hands: Iterable[HandSample], states: Iterable[DroneState]) -> None:
        """See `FlightStats.update`."""
        super().update(hands, ())
        known = [state for state in states if state.id in self._order]
        for state in sorted(known, key=lambda state: self._order[state.id]):
            super().update((), (state,))
            if self.latency_ms(state.id) is not None:
                self.first_ns.setdefault(state.id, state.stamp_ns)


def measure(
    *,
    scenario: str = "rhombus",
    n: int,
    warm_up: int = 1,
    overrides: Sequence[str] = (),
    say: Callable[[str], None] = lambda _: None,
) -> Report:
    """Measures starts.

    Args:
        scenario: What starts.
        n: How often.
        warm_up: How often before, to fill the caches of the file system.
        overrides: `key=value` items for the scenario.
        say: Told what is going on.

    Raises:
        ConfigError: The scenario is refused.
        BenchError: It did not start.
    """
    formation = build_formation(load_scenario(scenario, overrides), scenario)
    starts = []
    for turn in range(1 - warm_up, n + 1):
        say(f"start {turn} of {n}" if turn > 0 else "warm-up")
        starts.append(_start_once(scenario, overrides, _import_only(len(formation.ids))))
    counted = starts[warm_up:]
    of = {
        name: spread([getattr(start, name) for start in counted]) for name in ("total_s", *PARTS, "imports_s")
    }
    record = {
        "p50_s": of["total_s"].p50,
        "n": n,
        "p10_s": of["total_s"].p10,
        "p90_s": of["total_s"].p90,
        **{name: of[name].p50 for name in (*PARTS, "imports_s")},
    }
    labels = {"total_s": "command to first formation-wide step", **PARTS}
    labels["imports_s"] = "beside it: the same processes, importing only"
    sheet = Sheet(
        title=f"Start of {scenario}, s",
        columns=("", *TEXT_COLUMNS),
        rows=tuple((label, *of[name].text()) for name, label in labels.items()),
    )
    return Report(name="start", records=(record,), sheets=(sheet,), draw=lambda figure: _draw(figure, counted))


def _import_only(drones: int) -> float:
    """Runs the processes of a flight as far as their imports, all at once; returns the time, s."""
    modules = ["agents.vehicles.world.__main__", *["agents.__main__"] * drones]
    started = time.monotonic()
    processes = [
        # Sessions of their own, as the supervisor's: the kernel shares the processor out by session.
        subprocess.Popen([sys.executable, "-P", "-c", f"import {module}"], start_new_session=True)
        for module in modules
    ]
    for process in processes:
        process.wait()
    return time.monotonic() - started


def _start_once(scenario: str, overrides: Sequence[str], imports_s: float) -> Start:
    clock = system_clock()
    with tempfile.TemporaryDirectory() as folder:
        runs = Path(folder)
        items = [word for item in overrides for word in ("--set", item)]
        command = [sys.executable, "-P", "-m", "deploy.cli", "up", scenario, "--runs", folder, *items]
        begun = clock()
        with subprocess.Popen(
            [*command, "--no-live"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        ) as process:
            try:
                return _watch(process, runs / LATEST / SCENARIO_FILE, clock, begun, imports_s)
            finally:
                _end(process)


def _end(process: "subprocess.Popen[bytes]") -> None:
    """Lets it land and end what it has started; what does not end is killed, and its children with it."""
    process.send_signal(signal.SIGINT)
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.kill()


def _watch(process: "subprocess.Popen[bytes]", file: Path, clock: Clock, begun: int, imports_s: float) -> Start:
    def until(done: Callable[[], bool]) -> int:
        while not done():
            if process.poll() is not None:
                raise BenchError(f"swarmtouch up ended with code {process.returncode}; try it by hand")
            if clock() - begun > LIMIT_S * NS_PER_S:
                raise BenchError(f"no formation-wide step after {LIMIT_S:.0f} s")
            time.sleep(_PERIOD_S)
        return clock()

    until(lambda: _read(file) is not None)
    resolved = file.stat().st_mtime_ns
    scenario = load_scenario(file)
    formation = build_formation(scenario)
    members = {_port(scenario, formation, node) for node in (WORLD, *map(drone_node, formation.ids))}
    opened = until(lambda: members <= _listening())
    # Only now: a link that is dialled before its listener is there comes up to a second late.
    relayed = until(lambda: _port(scenario, formation, RELAY) in _listening())
    with join(scenario, formation, BRIDGE) as bus:
        monitor, first = Monitor(bus, formation, clock), FirstSteps(formation)
        monitor.stats = first

        def has_stepped() -> bool:
            monitor.drain()
            return len(first.first_ns) == len(formation.ids)

        until(has_stepped)
    stepped = max(first.first_ns.values())
    return Start(
        launcher_s=(resolved - begun) / NS_PER_S,
        members_s=(opened - resolved) / NS_PER_S,
        relay_s=(relayed - opened) / NS_PER_S,
        step_s=(stepped - relayed) / NS_PER_S,
        imports_s=imports_s,
    )


def _port(scenario: Scenario, formation: Formation, node: str) -> int:
    return int(endpoint(scenario, formation, node).rpartition(":")[2])


def _listening() -> set[int]:
    """Returns the TCP ports of this machine that somebody listens on, as Linux lists them."""
    rows = (line.split() for line in _SOCKETS.read_text(encoding="ascii").splitlines()[1:])
    return {int(row[1].rpartition(":")[2], 16) for row in rows if row[3] == _LISTEN}


def _read(file: Path) -> Scenario | None:
    """Returns the resolved scenario once it is there and complete."""
    try:
        scenario = load_scenario(file)
    except ConfigError:
        return None
    return scenario if BRIDGE in scenario.net.endpoints else None


def _draw(figure: Any, starts: Sequence[Start]) -> None:
    axes = figure.subplots()
    left = [0.0] * len(starts)
    rows = [str(number) for number in range(1, len(starts) + 1)]
    for name, label in PARTS.items():
        widths = [getattr(start, name) for start in starts]
        axes.barh(rows, widths, left=left, label=label)
        left = [a + b for a, b in zip(left, widths, strict=True)]
    importing = [start.launcher_s + start.imports_s for start in starts]
    axes.plot(importing, rows, "D", color=INK, label="had they only imported")
    axes.set(xlabel="time since the command, s", ylabel="start")
    figure.legend(loc="outside upper center", ncols=2, fontsize="small")
