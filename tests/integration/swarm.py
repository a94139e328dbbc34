"""Swarms of real processes: by the launcher, or with each process started and killed by the test."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from attrs import frozen

from deploy.launcher.ports import free_ports
from deploy.launcher.process_table import ProcessRow, process_table, resolve_scenario
from shared.config import dump_scenario, load_scenario
from shared.formation import Formation, build_formation
from shared.messages import Mode
from shared.nodes import all_nodes
from shared.process import LAUNCHER_PID
from shared.scenario import Scenario
from shared.scenario_check.checked import leave_checked
from tests.integration.recorder import RELAY, START_S, Recorder


class Swarm:
    """The processes of a scenario, each started and killed by the test, and a recorder.

    Args:
        name: Scenario.
        hand: URI of the hand.
        folder: Where logs go.
        overrides: `key=value` items.
    """

    def __init__(self, name: str, hand: str, folder: Path, overrides: Sequence[str] = ()) -> None:
        raw = load_scenario(name, overrides)
        self.formation = formation = build_formation(raw)
        self.scenario = self.place(raw, formation)
        self.ids = formation.ids
        self._folder = folder
        file = folder / "scenario.toml"
        file.write_text(dump_scenario(self.scenario), encoding="utf-8")
        leave_checked(file, self.scenario)
        rows = process_table(self.scenario, formation, file=file, hand=hand, run_dir=folder)
        self._rows: dict[str, ProcessRow] = {row.token: row for row in rows}
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.recorder = self.open_recorder()

    def place(self, raw: Scenario, formation: Formation) -> Scenario:
        """Returns the scenario with an address for everybody; here free ports on loopback."""
        tcp, (udp,) = free_ports(tcp=len(all_nodes(formation)), udp=1)
        return resolve_scenario(raw, formation, tcp, udp)

    def open_recorder(self) -> Recorder:
        """Opens a recorder that reaches everybody."""
        return Recorder(self.scenario)

    def command(self, row: ProcessRow) -> tuple[str, ...]:
        """Returns the command line of a process."""
        return row.command

    def start_all(self) -> None:
        """Starts the world and the agents, and the relay when everybody listens."""
        members = set(self._rows) - {RELAY}
        for token in members:
            self.start(token)
        self.recorder.until(lambda: members <= self.recorder.present, START_S)
        self.start(RELAY)

    def start(self, token: str) -> None:
        """Starts one process."""
        row = self._rows[token]
        environment = {LAUNCHER_PID: str(os.getpid()), "OPENBLAS_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}
        with (self._folder / f"{row.name}.log").open("ab") as log:
            self.processes[token] = subprocess.Popen(
                self.command(row),
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                env={**os.environ, **environment},
            )

    def kill(self, token: str) -> int:
        """Kills one process with SIGKILL; returns the moment on the clock of the swarm, ns."""
        moment = self.recorder.clock()
        process = self.processes.pop(token)
        process.kill()
        process.communicate()
        return moment

    def pause(self, token: str, seconds: float) -> None:
        """Stops one process for a while."""
        self.processes[token].send_signal(signal.SIGSTOP)
        try:
            self.recorder.listen(seconds)
        finally:
            self.processes[token].send_signal(signal.SIGCONT)

    def fly(self) -> None:
        """Starts everything and waits until the whole formation follows."""
        self.start_all()
        self.recorder.until(lambda: self.recorder.all_in(Mode.FOLLOW), START_S)

    def land(self) -> None:
        """Orders the landing and waits until everybody is down."""
        orders = self.processes[RELAY].stdin
        assert orders is not None
        orders.write(b"land\n")
        orders.flush()
        self.recorder.until(lambda: self.recorder.all_in(Mode.GROUND), START_S)

    def end(self) -> dict[str, int]:
        """Ends every process with SIGTERM; returns the exit codes."""
        for process in self.processes.values():
            process.terminate()
        return {token: process.wait(10.0) for token, process in self.processes.items()}

    def referee(self) -> dict[str, Any]:
        """Returns what the simulated world saw."""
        report: dict[str, Any] = json.loads((self._folder / "referee.json").read_text(encoding="utf-8"))
        return report

    def logs(self) -> str:
        """Returns what all processes have logged."""
        return "\n".join(path.read_text(errors="replace") for path in sorted(self._folder.glob("*.log")))

    def close(self) -> None:
        """Kills what is left."""
        for process in self.processes.values():
            process.kill()
            process.communicate()
        self.recorder.close()


@contextmanager
def swarm_of(name: str, hand: str, folder: Path, *overrides: str) -> Iterator[Swarm]:
    """Makes a swarm and ends it for sure."""
    swarm = Swarm(name, hand, folder, overrides)
    try:
        yield swarm
    finally:
        swarm.close()


@frozen
class Launched:
    """A flight by `swarmtouch up`, heard from outside."""

    launcher: subprocess.Popen[str]
    scenario: Scenario
    recorder: Recorder
    runs: Path

    def end(self) -> dict[str, Any]:
        """Interrupts the flight; returns its summary once it has landed."""
        self.launcher.send_signal(signal.SIGINT)
        output, _ = self.launcher.communicate(timeout=60)
        summary: dict[str, Any] = json.loads(output.splitlines()[-1])
        return summary

    def logs(self) -> str:
        """Returns what all processes have logged."""
        return "\n".join(
            path.read_text(errors="replace") for path in sorted(self.runs.glob("latest/logs/*.log"))
        )


@contextmanager
def launched(
    name: str, hand: str, runs: Path, *overrides: str, arguments: Sequence[str] = (), flying: bool = True
) -> Iterator[Launched]:
    """Flies by `swarmtouch up`, and ends for sure; `flying`: begins when the whole formation follows."""
    command = [sys.executable, "-m", "deploy.cli", "up", name, "--hand", hand, "--runs", str(runs), "--json"]
    command += arguments
    command += [argument for override in overrides for argument in ("--set", override)]
    file = runs / "latest" / "scenario.toml"
    with (runs / "launcher.log").open("wb") as log:
        launcher = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
    try:
        deadline = time.monotonic() + START_S
        while not file.exists() or not file.read_text():
            assert time.monotonic() < deadline
            time.sleep(0.02)
        scenario = load_scenario(file)
        with Recorder(scenario) as recorder:
            recorder.until(lambda: not flying or recorder.all_in(Mode.FOLLOW), START_S)
            yield Launched(launcher, scenario, recorder, runs)
    finally:
        launcher.kill()
        launcher.communicate()
