"""One flight: start everybody, watch, land, end everybody."""

import asyncio
import json
import math
import signal
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Protocol

from attrs import frozen

from agents.control.modes import HAND_LAND
from deploy.launcher.monitor import Monitor
from deploy.launcher.process_table import ProcessRow
from deploy.launcher.supervisor import Child, Supervisor
from deploy.terminal.job_control import has_shell, stop_here, watch_signals
from deploy.terminal.keyboard import Keyboard
from shared.formation import Formation
from shared.nodes import RELAY, WORLD

LANDING_S = 6.0
"""A landing at the end of the flight may take so long,"""
INTERRUPTED_LANDING_S = 4.5
"""and so long after Ctrl-C: with the rest below everything has ended within 6 s."""
SETTLING_S = 2.0
"""From a height that takes longer the landing has so much more than the descent itself."""
HAND_S = 12.0
"""The hand is awaited for so long, when a flight begins and when a stopped one goes on."""
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

    def leave(self) -> None:
        """Leaves the terminal to others, until the next tick."""


@frozen(kw_only=True)
class Outcome:
    """How a flight went.

    Attributes:
        seconds: From the start of the relay to the end of the landing.
        unexpected_exits: Exit codes by process name.
        restarts: How many processes were started again.
        failed_starts: How often the system could not start a process, by name.
        landed: Whether every drone was on the ground at the end, without an emergency stop.
        stopped: Drones whose motors an emergency stop has cut, wherever they were.
        interrupted: Whether the operator has ended it early.
        early: Whether that was before a drone could have taken off.
        refused: Processes that refused their configuration.
        simulated: Whether there was a simulated world with a referee.
        referee: What the referee saw; empty if that is unknown.
    """

    seconds: float
    unexpected_exits: dict[str, list[int]]
    restarts: dict[str, int]
    failed_starts: dict[str, int]
    landed: bool
    stopped: tuple[int, ...]
    interrupted: bool
    early: bool
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
        seconds: Length of the flight from the first sample of the hand on; None: until the hand ends it.
        landing_speed: How fast drones descend, m/s.
        takeoff_s: How long a take-off takes, s.
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
        landing_speed: float,
        takeoff_s: float,
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
        self._left_s = math.inf if seconds is None else seconds
        self._landing_speed = landing_speed
        self._takeoff_s = takeoff_s
        self._hand_since = math.inf
        self._is_early = False
        self._view = view
        self._keyboard = Keyboard(self._key)
        self._interrupts = 0
        self._stop_asked = False

    async def run(self) -> Outcome:
        """Flies from the first process to the last; no process is left behind, whatever happens."""
        with watch_signals(self._interrupt, self._ask_stop), closing(self._keyboard):
            try:
                await self._start_members()
                started = time.monotonic()
                await self._fly()
                await self._land()
                seconds, landed = time.monotonic() - started, self.monitor.all_landed
            except Exception:
                await self._land_unseen()
                raise
            finally:
                self.phase = "ending"
                await self.supervisor.stop(GRACE_S[min(self._interrupts, len(GRACE_S) - 1)])
        self.monitor.drain()
        return self._outcome(seconds, landed)

    async def _start_members(self) -> None:
        for row in self._rows:
            if row.role != RELAY:
                self.supervisor.start(row)
        await self._until(lambda: not self.supervisor.awaited or self._cut_short, math.inf)
        if (missing := self.supervisor.missing) and not self._cut_short:
            self._view.event(f"no sign of {', '.join(missing)}; the hand starts without")

    async def _fly(self) -> None:
        if self._cut_short:
            return
        self.phase = "flying"
        for row in self._rows:
            if row.role == RELAY:
                self.supervisor.start(row)
        # The length of the flight counts from here: a busy machine takes its time to start a relay.
        await self._until(lambda: self.monitor.stats.hand is not None or self._is_called_off, HAND_S)
        self._hand_since = time.monotonic()
        await self._follow_hand()
        while self._stop_asked and not self._cut_short:
            await self._pause()
            await self._follow_hand()

    async def _follow_hand(self) -> None:
        begun = time.monotonic()
        await self._until(lambda: self.monitor.ended_by_hand or self._is_called_off, self._left_s)
        self._left_s -= time.monotonic() - begun

    async def _pause(self) -> None:
        """Lands and stops, as Ctrl-Z asks; flies on when the shell continues this process."""
        self.phase = "pausing"
        self.supervisor.order(_RELAY, "land")
        await self._until(lambda: self.monitor.all_down or self._cut_short, math.inf)
        self._stop_asked = False
        if not self._cut_short:
            self._view.event("everybody is down; fg flies on")
            self._view.leave()
            self._keyboard.close()
            stop_here()
            await self._resume()

    async def _resume(self) -> None:
        # A shell that ends continues its jobs so that they end: the signal for that may still be on its way.
        await asyncio.sleep(_PERIOD_S)
        if not self._cut_short:
            self.supervisor.order(_RELAY, "fly")
            await self._until(lambda: not self.monitor.ended_by_hand or self._cut_short, HAND_S)
            self.phase = "flying"

    async def _land(self) -> None:
        self.phase = "landing"
        self.supervisor.order(_RELAY, "land")
        await self._until(lambda: self.monitor.all_down or self._interrupts > 1, self._landing_s())

    async def _land_unseen(self) -> None:
        """Whatever is wrong with watching: who is in the air comes down before all processes end."""
        self.supervisor.order(_RELAY, "land")
        deadline = time.monotonic() + self._landing_s()
        while time.monotonic() < deadline and self._interrupts < 2:
            await asyncio.sleep(_PERIOD_S)

    def _landing_s(self) -> float:
        """Returns how long a landing from here may take, s."""
        height = max((state.position[2] for state in self.monitor.stats.latest.values()), default=0.0)
        usual = INTERRUPTED_LANDING_S if self._interrupts else LANDING_S
        # Whom no order reaches lands by itself.
        unheard = 0.0 if _RELAY in self.monitor.present else HAND_LAND
        return max(usual, height / self._landing_speed + SETTLING_S) + unheard

    async def _until(self, done: Callable[[], bool], limit_s: float) -> None:
        """Watches until it is done or time is up."""
        deadline = time.monotonic() + limit_s
        while not done() and time.monotonic() < deadline:
            await asyncio.sleep(_PERIOD_S)
            self._keyboard.attend()
            self.monitor.drain()
            self._view.tick(self)

    @property
    def _cut_short(self) -> bool:
        """Whether the operator or a process that refuses its configuration ends the flight early."""
        return self._interrupts > 0 or bool(self._refused())

    @property
    def _is_called_off(self) -> bool:
        """Whether it ends early, or pauses."""
        return self._cut_short or self._stop_asked

    def _outcome(self, seconds: float, landed: bool) -> Outcome:
        children = self.supervisor.children.values()
        return Outcome(
            seconds=seconds,
            unexpected_exits={child.row.name: child.exits for child in children if child.exits},
            restarts={child.row.token: child.restarts for child in children},
            failed_starts={child.row.name: child.failed_starts for child in children if child.failed_starts},
            landed=landed,
            stopped=self.monitor.stopped,
            interrupted=self._interrupts > 0,
            early=self._is_early,
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
        if not self._interrupts:
            self._is_early = time.monotonic() < self._hand_since + self._takeoff_s + SETTLING_S
        self._interrupts += 1

    def _ask_stop(self) -> None:
        if not has_shell():
            self._view.event("no shell could continue a stopped flight: it goes on")
            return
        self._stop_asked = True
        self._view.event("landing first, then stopping")

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
