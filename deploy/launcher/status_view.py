"""The flight as the operator sees it: a live table on a terminal, plain lines elsewhere."""

import math
import time
from collections.abc import Iterable
from pathlib import Path

from attrs import frozen
from rich import box
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table

from deploy.launcher.flight import Flight
from deploy.launcher.glove_panel import GlovePanel
from deploy.launcher.monitor import Monitor
from deploy.terminal.job_control import in_foreground
from deploy.terminal.streams import PatientStream
from shared.conditions import conditions
from shared.messages import DroneState, ProcessStatus
from shared.nodes import BRIDGE, DRONE

LIVE_PERIOD_S = 0.5
PLAIN_PERIOD_S = 5.0
_LEAVE_S = 0.5
"""So long a reader that stalls is waited for before the terminal is left to others."""
SUMMARISE_ABOVE = 16
"""With more agents than this only the unhealthy ones get a row."""
_COLUMNS = ("id", "mode", "height", "goal error", "latency", "rate", "rejected", "restarts", "cpu", "flags")


_HINT = "Ctrl-C lands, again: ends at once; space: STOP"


@frozen(kw_only=True)
class AgentRow:
    """One agent at this moment.

    Attributes:
        id: Number of the drone.
        alive: Whether its liveliness token is there.
        restarts: How often it was started again.
        state: Its newest state, None before the first.
        status: Its newest health, None before the first.
        latency_ms: Newest latency from the hand to its set-point, None if it has none.
    """

    id: int
    alive: bool = False
    restarts: int = 0
    state: DroneState | None = None
    status: ProcessStatus | None = None
    latency_ms: float | None = None

    @property
    def rejected(self) -> int:
        """Messages that it has dropped so far."""
        return sum(self.status.rejected.values()) if self.status else 0

    @property
    def unhealthy(self) -> bool:
        """Whether the operator should look at it."""
        flagged = self.state is not None and bool(self.state.flags)
        return not self.alive or flagged or bool(self.restarts or self.rejected)


def agent_rows(flight: Flight) -> list[AgentRow]:
    """Collects the rows of all agents."""
    return [_agent_row(flight, drone) for drone in flight.formation.ids]


def status_table(rows: Iterable[AgentRow], title: str, caption: str = "") -> Table:
    """Draws the rows; a large swarm is summarised.

    Args:
        rows: Every agent.
        title: Line above.
        caption: Line below.
    """
    everyone = list(rows)
    large = len(everyone) > SUMMARISE_ABOVE
    shown = [row for row in everyone if row.unhealthy] if large else everyone
    if large:
        caption = f"{len(everyone) - len(shown)} of {len(everyone)} agents are well. {caption}"
    table = Table(
        title=title,
        caption=caption,
        title_justify="left",
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        padding=0,
    )
    for column in _COLUMNS:
        table.add_column(
            column, justify="left" if column in ("mode", "flags") else "right", no_wrap=column != "flags"
        )
    for row in shown:
        table.add_row(str(row.id), *_cells(row), style=None if row.alive else "red")
    return table


def plain_lines(rows: Iterable[AgentRow]) -> list[str]:
    """Writes one `name | line` per agent; a large swarm is summarised."""
    everyone = list(rows)
    large = len(everyone) > SUMMARISE_ABOVE
    shown = [row for row in everyone if row.unhealthy] if large else everyone
    lines = [f"drone {row.id} | {_sentence(row)}" for row in shown]
    return (
        [*lines, f"swarm | {len(everyone) - len(shown)} of {len(everyone)} agents are well"] if large else lines
    )


class StatusView:
    """Shows a flight on a console.

    Args:
        console: Where.
        run_dir: Directory of the run, for the header.
        live: Whether to redraw a table in place; it needs a terminal, and waits while that is somebody else's.
        panel: Shows the glove below the table, None without one.
    """

    def __init__(self, console: Console, run_dir: Path, *, live: bool, panel: GlovePanel | None = None) -> None:
        self._console = console
        self._panel = panel
        self._fingers = ""
        self._run_dir = run_dir
        self._live = Live(console=console, auto_refresh=False, transient=True) if live else None
        self._period = LIVE_PERIOD_S if live else PLAIN_PERIOD_S
        self._due = 0.0
        self._phase = ""

    def __enter__(self) -> "StatusView":
        self.event(f"{self._run_dir}. {_HINT}")
        return self

    def __exit__(self, *_: object) -> None:
        self.leave()

    def leave(self) -> None:
        """Leaves the terminal to others, until the next tick."""
        if self._live:
            self._live.stop()
        if isinstance(self._console.file, PatientStream):
            self._console.file.settle(_LEAVE_S)

    def tick(self, flight: Flight) -> None:
        """Says so when the phase changes, and shows the agents when it is time."""
        now = time.monotonic()
        if flight.phase != self._phase:
            self._phase = flight.phase
            self.event(flight.phase)
            self._due = now + self._period
        fingers = self._panel.line(flight.monitor.glove.latest) if self._panel else ""
        if self._panel:
            bridge = flight.monitor.health.get(f"{BRIDGE}/0")
            for text in self._panel.unfelt(flight.monitor.glove.failed, bridge.status if bridge else None):
                self.alarm(text)
        if now < self._due and (not self._live or fingers == self._fingers):
            return
        self._due, self._fingers = now + self._period, fingers
        rows, hand = agent_rows(flight), _hand_words(flight.monitor)
        if self._live:
            table = status_table(
                rows, f"{flight.phase}: {self._run_dir}", "\n".join(filter(None, (hand, _HINT)))
            )
            if in_foreground(self._console.file.fileno()):
                self._live.start()
                self._live.update(Group(table, fingers) if fingers else table, refresh=True)
            return
        for line in (*plain_lines(rows), *([f"hand | {hand}"] if hand else [])):
            self._print(line)

    def event(self, text: str) -> None:
        """Prints one line that stays."""
        self._print(f"launcher | {text}")

    def alarm(self, text: str) -> None:
        """Prints one line that is heard as well, where there is a terminal."""
        self.event(text)
        if self._console.is_terminal:
            self._console.bell()

    def _print(self, line: str) -> None:
        self._console.print(line, soft_wrap=True)


def _hand_words(monitor: Monitor) -> str:
    rejected = monitor.rejected_poses
    return f"{rejected} poses of the hand are impossible: see relay.log" if rejected else ""


def _agent_row(flight: Flight, drone: int) -> AgentRow:
    token = f"{DRONE}/{drone}"
    monitor = flight.monitor
    child = flight.supervisor.children.get(token)
    health = monitor.health.get(token)
    return AgentRow(
        id=drone,
        alive=token in monitor.present,
        restarts=child.restarts if child else 0,
        state=monitor.stats.latest.get(drone),
        status=health.status if health else None,
        latency_ms=monitor.stats.latency_ms(drone),
    )


def _cells(row: AgentRow) -> tuple[str, ...]:
    """The cells after the id; `-` where nothing is known yet."""
    state, status = row.state, row.status
    flags = [] if row.alive else ["absent"]
    flags += conditions(state) if state else []
    return (
        state.mode.value if state else "-",
        f"{state.position[2]:.2f} m" if state else "-",
        f"{math.dist(state.position, state.goal):.2f} m" if state else "-",
        "-" if row.latency_ms is None else f"{row.latency_ms:.1f} ms",
        f"{status.rate_hz:.0f} Hz" if status else "-",
        str(row.rejected),
        str(row.restarts),
        f"{status.cpu:.0%}" if status else "-",
        ", ".join(flags),
    )


def _sentence(row: AgentRow) -> str:
    return ", ".join(f"{name} {cell}" for name, cell in zip(_COLUMNS[1:], _cells(row), strict=True) if cell)
