"""Keeps processes running: spawn, log, restart with backoff, end without leaving one behind.

Every process leads its own session, so that Ctrl-C in the terminal reaches the launcher alone, and asks the
kernel to die with the launcher (`shared.process`), however that ends. What cannot be started is tried again and
again; nothing here gives up without saying so.
"""

import asyncio
import os
import signal
import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import IO

from attrs import define, field

from deploy.launcher.process_table import ProcessRow
from observer.console.arguments import TOKEN_VARIABLE
from shared.nodes import CONSOLE
from shared.process import EXIT_REFUSED, LAUNCHER_PID

FIRST_BACKOFF_S = 0.25
LONGEST_BACKOFF_S = 4.0
STEADY_S = 10.0
"""A process that has run for so long is restarted without delay growth."""
AT_ONCE = 8
"""So many processes start at the same time: more would starve each other's links until they count as dead."""
ARRIVAL_S = 12.0
"""A process has this long to come to work before the others go on without it, and as long again per
`CROWD` processes, s."""
CROWD = 16
_PERIOD_S = 0.04


@define
class Child:
    """One supervised process.

    Attributes:
        row: Its row in the process table.
        exits: Exit codes of its unexpected ends.
        starts: How often it has been started.
        failed_starts: How often the system could not start it.
        refused: Whether it refused its configuration when it was first started.
        given_up: Whether it has ended and is not started again.
        process: What runs now, None between two starts.
        first: When it was first its turn to start, monotonic, s; None before.
        since: When it was last started, monotonic, s.
        hurry: Set when it is to be started without further delay, or not at all.
    """

    row: ProcessRow
    exits: list[int] = field(factory=list)
    starts: int = 0
    failed_starts: int = 0
    refused: bool = False
    given_up: bool = False
    process: asyncio.subprocess.Process | None = None
    first: float | None = None
    since: float = 0.0
    hurry: asyncio.Event = field(factory=asyncio.Event)

    @property
    def restarts(self) -> int:
        """How often it has been started again."""
        return max(0, self.starts - 1)


OnExit = Callable[[Child, int, float | None], None]
"""Called with the child, its exit code and the delay until it starts again (None: it does not)."""


class Supervisor:
    """Runs the processes of one flight, and starts them a few at a time.

    Args:
        log_dir: Where each process gets a file `<name>.log` for its output.
        on_exit: Told about every unexpected end.
        say: Told what the operator should know beside that.
        is_up: Whether the process of a token is at work, so that the next one may start.
        files: What processes read when they start; written again should somebody have deleted it in flight.
    """

    def __init__(
        self,
        log_dir: Path,
        on_exit: OnExit,
        *,
        say: Callable[[str], None] = lambda _: None,
        is_up: Callable[[str], bool] = lambda _: True,
        files: Mapping[Path, str] | None = None,
    ) -> None:
        self.children: dict[str, Child] = {}
        self._log_dir = log_dir
        self._on_exit = on_exit
        self._say = say
        self._is_up = is_up
        self._files = files or {}
        self._orders: defaultdict[str, list[str]] = defaultdict(list)
        self._starting = asyncio.Semaphore(AT_ONCE)
        self._ending = asyncio.Event()
        self._keepers: list[asyncio.Task[None]] = []

    @property
    def missing(self) -> list[str]:
        """Tokens of the processes that are not at work."""
        return [token for token in self.children if not self._is_up(token)]

    @property
    def awaited(self) -> bool:
        """Whether somebody who is not at work yet may still come in time."""
        return any(self._may_come(self.children[token]) for token in self.missing)

    def start(self, row: ProcessRow) -> None:
        """Starts one process, when it is its turn, and keeps it running until `stop`."""
        child = Child(row)
        self.children[row.token] = child
        self._keepers.append(asyncio.create_task(self._keep(child)))

    def order(self, token: str, line: str) -> None:
        """Sends one line to a process.

        When it is started later, or again, it gets all its lines then; and it waits for that no longer.
        """
        self._orders[token].append(line)
        child = self.children.get(token)
        if child is not None:
            _write(child, [line])
            child.hurry.set()

    async def stop(self, grace_s: float) -> None:
        """Ends every process: TERM, after `grace_s` KILL; returns when none is left."""
        self._ending.set()
        for child in self.children.values():
            child.hurry.set()
        self._signal_all(signal.SIGTERM)
        if self._keepers:
            _, running = await asyncio.wait(self._keepers, timeout=grace_s)
            if running:
                self._signal_all(signal.SIGKILL)
                await asyncio.wait(running)
            for keeper in self._keepers:
                keeper.result()

    def _may_come(self, child: Child) -> bool:
        in_time = child.first is None or time.monotonic() < self._deadline(child.first)
        return in_time and not child.given_up

    def _deadline(self, start: float) -> float:
        return start + ARRIVAL_S * (1.0 + len(self.children) / CROWD)

    async def _keep(self, child: Child) -> None:
        backoff = FIRST_BACKOFF_S
        while not self._ending.is_set():
            child.hurry.clear()
            try:
                code = await self._run(child)
            except OSError as error:
                child.failed_starts += 1
                self._say(f"{child.row.name} cannot be started: {error}; next try in {backoff:.2f} s")
            else:
                if self._ending.is_set():
                    return
                if time.monotonic() - child.since >= STEADY_S:
                    backoff = FIRST_BACKOFF_S
                if not self._starts_again(child, code, backoff):
                    return
            with suppress(TimeoutError):
                await asyncio.wait_for(child.hurry.wait(), backoff)
            backoff = min(2.0 * backoff, LONGEST_BACKOFF_S)

    def _starts_again(self, child: Child, code: int, backoff: float) -> bool:
        """Tells of an unexpected end, and decides what comes after it."""
        child.exits.append(code)
        # Who has been at work is not given up for a file that is missing now.
        child.refused = code == EXIT_REFUSED and child.starts == 1
        child.given_up = child.refused or not child.row.restarts
        self._on_exit(child, code, None if child.given_up else backoff)
        return not child.given_up

    async def _run(self, child: Child) -> int:
        # Who takes the operator's orders, STOP among them, stands in no queue.
        place = nullcontext() if child.row.takes_orders else self._starting
        try:
            async with place:
                if self._ending.is_set():
                    return 0
                child.first = child.first or time.monotonic()
                process = await self._spawn(child)
                await self._arrival(child, process)
            return await process.wait()
        except asyncio.CancelledError:
            if child.process is not None:
                _signal(child, signal.SIGKILL)
                await child.process.wait()
            raise
        finally:
            child.process = None

    async def _spawn(self, child: Child) -> asyncio.subprocess.Process:
        self._put_back_files()
        with self._open_log(child) as log:
            child.process = process = await asyncio.create_subprocess_exec(
                *child.row.command,
                stdin=asyncio.subprocess.PIPE if child.row.takes_orders else asyncio.subprocess.DEVNULL,
                stdout=log,
                stderr=asyncio.subprocess.STDOUT,
                start_new_session=True,
                env=_environment(child.row),
            )
        child.starts += 1
        child.since = time.monotonic()
        if self._ending.is_set():  # asked to end while the process was being created
            _signal(child, signal.SIGTERM)
        _write(child, self._orders[child.row.token])
        return process

    async def _arrival(self, child: Child, process: asyncio.subprocess.Process) -> None:
        """Waits until a process is at work, has ended, or has had its time."""
        while not (
            self._is_up(child.row.token)
            or process.returncode is not None
            or self._ending.is_set()
            or time.monotonic() >= self._deadline(child.since)
        ):
            await asyncio.sleep(_PERIOD_S)

    def _open_log(self, child: Child) -> IO[bytes]:
        path = self._log_dir / f"{child.row.name}.log"
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            return path.open("ab")
        except OSError as error:
            self._say(f"{child.row.name} goes on without a log: {error}")
            return open(os.devnull, "wb")

    def _put_back_files(self) -> None:
        for path, text in self._files.items():
            try:
                if path.exists():
                    continue
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text, encoding="utf-8")
                self._say(f"{path} was gone, and has been written again")
            except OSError as error:
                self._say(f"{path} is gone, and cannot be written again: {error}")

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
