"""Keeps processes running: spawn, log, restart with backoff, end without leaving one behind.

Every process leads its own session, so that Ctrl-C in the terminal reaches the launcher alone, and asks the
kernel to die with the launcher (`shared.process`), however that ends.
"""

import asyncio
import os
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from attrs import define, field

from deploy.launcher.process_table import ProcessRow
from observer.console.arguments import TOKEN_VARIABLE
from shared.nodes import CONSOLE
from shared.process import EXIT_REFUSED, LAUNCHER_PID

FIRST_BACKOFF_S = 0.25
LONGEST_BACKOFF_S = 4.0
STEADY_S = 10.0
"""A process that has run for so long is restarted without delay growth."""


@define
class Child:
    """One supervised process.

    Attributes:
        row: Its row in the process table.
        exits: Exit codes of its unexpected ends.
        starts: How often it has been started.
        refused: Whether it refused its configuration.
    """

    row: ProcessRow
    exits: list[int] = field(factory=list)
    starts: int = 0
    refused: bool = False
    process: asyncio.subprocess.Process | None = None
    orders: list[str] = field(factory=list)

    @property
    def restarts(self) -> int:
        """How often it has been started again."""
        return max(0, self.starts - 1)


OnExit = Callable[[Child, int, float | None], None]
"""Called with the child, its exit code and the delay until it starts again (None: it does not)."""


class Supervisor:
    """Runs the processes of one flight.

    Args:
        log_dir: Where each process gets a file `<name>.log` for its output.
        on_exit: Told about every unexpected end.
    """

    def __init__(self, log_dir: Path, on_exit: OnExit) -> None:
        self.children: dict[str, Child] = {}
        self._log_dir = log_dir
        self._on_exit = on_exit
        self._ending = asyncio.Event()
        self._keepers: list[asyncio.Task[None]] = []

    def start(self, row: ProcessRow) -> None:
        """Starts one process and keeps it running until `stop`."""
        child = Child(row)
        self.children[row.token] = child
        self._keepers.append(asyncio.create_task(self._keep(child)))

    def order(self, token: str, line: str) -> None:
        """Sends one line to a process; if it is restarted it gets all its lines again."""
        child = self.children.get(token)
        if child is not None:
            child.orders.append(line)
            _write(child, [line])

    async def stop(self, grace_s: float) -> None:
        """Ends every process: TERM, after `grace_s` KILL; returns when none is left."""
        self._ending.set()
        self._signal_all(signal.SIGTERM)
        if self._keepers:
            _, running = await asyncio.wait(self._keepers, timeout=grace_s)
            if running:
                self._signal_all(signal.SIGKILL)
                await asyncio.wait(running)
            for keeper in self._keepers:
                keeper.result()

    async def _keep(self, child: Child) -> None:
        backoff = FIRST_BACKOFF_S
        while not self._ending.is_set():
            started = time.monotonic()
            code = await self._run(child)
            if self._ending.is_set():
                return
            child.exits.append(code)
            child.refused = code == EXIT_REFUSED
            if time.monotonic() - started >= STEADY_S:
                backoff = FIRST_BACKOFF_S
            again = child.row.restarts and not child.refused
            self._on_exit(child, code, backoff if again else None)
            if not again:
                return
            with suppress(TimeoutError):
                await asyncio.wait_for(self._ending.wait(), backoff)
            backoff = min(2.0 * backoff, LONGEST_BACKOFF_S)

    async def _run(self, child: Child) -> int:
        with (self._log_dir / f"{child.row.name}.log").open("ab") as log:
            child.process = await asyncio.create_subprocess_exec(
                *child.row.command,
                stdin=asyncio.subprocess.PIPE if child.row.takes_orders else asyncio.subprocess.DEVNULL,
                stdout=log,
                stderr=asyncio.subprocess.STDOUT,
                start_new_session=True,
                env=_environment(child.row),
            )
        child.starts += 1
        if self._ending.is_set():  # asked to end while the process was being created
            _signal(child, signal.SIGTERM)
        _write(child, child.orders)
        try:
            return await child.process.wait()
        except asyncio.CancelledError:
            _signal(child, signal.SIGKILL)
            await child.process.wait()
            raise
        finally:
            child.process = None

    def _signal_all(self, number: signal.Signals) -> None:
        for child in self.children.values():
            _signal(child, number)


def _signal(child: Child, number: signal.Signals) -> None:
    process = child.process
    if process is not None and process.returncode is None:
        # Its own `send_signal` would reap one that has just ended: asyncio would miss the exit code and say so.
        with suppress(ProcessLookupError):
            os.kill(process.pid, number)


def _write(child: Child, lines: list[str]) -> None:
    pipe = child.process.stdin if child.process else None
    if pipe is not None and not pipe.is_closing():
        pipe.write("".join(f"{line}\n" for line in lines).encode())


def _environment(row: ProcessRow) -> dict[str, str]:
    # Only the console has a use for its token.
    hidden = set() if row.role == CONSOLE else {TOKEN_VARIABLE}
    return {
        **{name: value for name, value in os.environ.items() if name not in hidden},
        LAUNCHER_PID: str(os.getpid()),
        "PYTHONUNBUFFERED": "1",
        # The matrices of one agent are tiny: a pool of BLAS threads in each process would only cost memory.
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
    }
