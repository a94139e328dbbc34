"""One flight: start everybody, watch, land, end everybody."""

import asyncio
import json
import math
import signal
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

from attrs import frozen

from deploy.launcher.keyboard import key_presses
from deploy.launcher.monitor import Monitor
from deploy.launcher.process_table import ProcessRow
from deploy.launcher.supervisor import Child, Supervisor
from shared.formation import Formation
from shared.nodes import RELAY, WORLD

LANDING_S = 6.0
"""A landing at the end of the flight may take so long,"""
INTERRUPTED_LANDING_S = 4.5
"""and so long after Ctrl-C: with the rest below everything has ended within 6 s."""
GRACE_S = (2.0, 1.0, 0.4)
"""From TERM to KILL at the end, after the first and after the second Ctrl-C (which ends all within 1 s)."""
_PERIOD_S = 0.04
_RELAY = f"{RELAY}/0"


class View(Protocol):
    """Where a flight shows itself."""

    def tick(self, flight: "Flight") -> None:
        """Called 25 times a second."""

    def event(self, text: str) -> None:
        """Something happened that the operator should read."""


@frozen(kw_only=True)
class Outcome:
    """How a flight went.

    Attributes:
        seconds: From the start of the relay to the end of the landing.
        unexpected_exits: Exit codes by process name.
        restarts: How many processes were started again.
        failed_starts: How often the system could not start a process, by name.
        landed: Whether every drone was on the ground at the end, without an emergency stop.
        refused: Processes that refused their configuration.
        simulated: Whether there was a simulated world with a referee.
        referee: What the referee saw; empty if that is unknown.
    """

    seconds: float
    unexpected_exits: dict[str, list[int]]
    restarts: dict[str, int]
    failed_starts: dict[str, int]
    landed: bool
    refused: tuple[str, ...]
    simulated: bool
    referee: dict[str, float]


class Flight:
    """One flight on this machine.

    Args:
        formation: What flies.
        rows: The process table.
        monitor: What is heard of the flight.
        run_dir: Directory of this run.
        files: What processes read when they start, see `Supervisor`.
        seconds: Length of the flight; None: until the hand ends it.
        view: Where to show it.
    """

    def __init__(
        self,
        *,
        formation: Formation,
        rows: tuple[ProcessRow, ...],
        monitor: Monitor,
        run_dir: Path,
        files: Mapping[Path, str],
        seconds: float | None,
        view: View,
    ) -> None:
        self.formation = formation
        self.monitor = monitor
        self.run_dir = run_dir
        self.phase = "starting"
        self.supervisor = Supervisor(
            run_dir / "logs",
            self._unexpected_exit,
            say=view.event,
            is_up=lambda token: token in monitor.present,
            files=files,
        )
        self._rows = rows
        self._seconds = seconds
        self._view = view
        self._interrupts = 0

    async def run(self) -> Outcome:
        """Flies from the first process to the last; no process is left behind, whatever happens."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            loop.add_signal_handler(number, self._interrupt)
        seconds, landed = 0.0, False
        try:
            with key_presses(self._key):
                await self._start_members()
                started = time.monotonic()
                await self._fly()
                await self._land()
                seconds, landed = time.monotonic() - started, self.monitor.all_landed
        finally:
            self.phase = "ending"
            await self.supervisor.stop(GRACE_S[min(self._interrupts, len(GRACE_S) - 1)])
            self.monitor.drain()
        return self._outcome(seconds, landed)

    async def _start_members(self) -> None:
        for row in self._rows:
            if row.role != RELAY:
                self.supervisor.start(row)
        await self._until(lambda: not self.supervisor.awaited or self._cut_short, None)
        if (missing := self.supervisor.missing) and not self._cut_short:
            self._view.event(f"no sign of {', '.join(missing)}; the hand starts without")

    async def _fly(self) -> None:
        if self._cut_short:
            return
        self.phase = "flying"
        for row in self._rows:
            if row.role == RELAY:
                self.supervisor.start(row)
        await self._until(lambda: self.monitor.ended_by_hand or self._cut_short, self._seconds)

    async def _land(self) -> None:
        self.phase = "landing"
        self.supervisor.order(_RELAY, "land")
        limit = INTERRUPTED_LANDING_S if self._interrupts else LANDING_S
        await self._until(lambda: self.monitor.all_down or self._interrupts > 1, limit)

    async def _until(self, done: Callable[[], bool], limit_s: float | None) -> None:
        """Watches until it is done or, if there is a limit, time is up."""
        deadline = math.inf if limit_s is None else time.monotonic() + limit_s
        while not done() and time.monotonic() < deadline:
            await asyncio.sleep(_PERIOD_S)
            self.monitor.drain()
            self._view.tick(self)

    @property
    def _cut_short(self) -> bool:
        """Whether the operator or a process that refuses its configuration ends the flight early."""
        return self._interrupts > 0 or bool(self._refused())

    def _outcome(self, seconds: float, landed: bool) -> Outcome:
        children = self.supervisor.children.values()
        return Outcome(
            seconds=seconds,
            unexpected_exits={child.row.name: child.exits for child in children if child.exits},
            restarts={child.row.token: child.restarts for child in children},
            failed_starts={child.row.name: child.failed_starts for child in children if child.failed_starts},
            landed=landed,
            refused=self._refused(),
            simulated=any(row.role == WORLD for row in self._rows),
            referee=self._read_referee(),
        )

    def _refused(self) -> tuple[str, ...]:
        return tuple(child.row.name for child in self.supervisor.children.values() if child.refused)

    def _read_referee(self) -> dict[str, float]:
        """Returns the referee's last report; where the disk has kept none, what the world last said."""
        try:
            report: dict[str, float] = json.loads((self.run_dir / "referee.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            health = self.monitor.health.get(f"{WORLD}/0")
            return health.status.metrics if health and health.status else {}
        return report

    def _interrupt(self) -> None:
        self._interrupts += 1

    def _key(self, key: str) -> None:
        if key == " ":
            self.supervisor.order(_RELAY, "stop")
            self._view.event("STOP")

    def _unexpected_exit(self, child: Child, code: int, delay_s: float | None) -> None:
        then = "it stays down" if delay_s is None else f"it starts again in {delay_s:.2f} s"
        log = self.run_dir / "logs" / f"{child.row.name}.log"
        self._view.event(f"{child.row.name} ended unexpectedly ({exit_word(code)}); {then}; see {log}")


def exit_word(code: int) -> str:
    """Names an exit code, or the signal that it stands for."""
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"
