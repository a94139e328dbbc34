"""Real, tiny child processes for the supervisor."""

import asyncio
import sys
from collections.abc import Callable
from pathlib import Path

from deploy.launcher.process_table import ProcessRow
from deploy.launcher.supervisor import Child

STUBBORN = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('up'); time.sleep(600)"
PATIENT = "import time; print('up'); time.sleep(600)"


def row(code: str, *, name: str = "child", takes_orders: bool = False, restarts: bool = True) -> ProcessRow:
    return ProcessRow(
        role=name,
        number=0,
        command=(sys.executable, "-c", code),
        restarts=restarts,
        takes_orders=takes_orders,
    )


class Exits:
    """Collects unexpected ends."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, float | None]] = []

    def __call__(self, _: Child, code: int, delay: float | None) -> None:
        self.seen.append((code, delay))


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(30.0):
        while not condition():
            await asyncio.sleep(0.01)


def log_of(tmp_path: Path, name: str = "child") -> str:
    path = tmp_path / f"{name}.log"
    return path.read_text() if path.exists() else ""


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False
