"""The supervisor with real, tiny child processes."""

import asyncio
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from deploy.launcher.supervisor import FIRST_BACKOFF_S, LONGEST_BACKOFF_S, Child, Supervisor
from tests.integration.children import PATIENT, STUBBORN, Exits, is_running, log_of, row, until

pytestmark = pytest.mark.parallel


def test_a_process_that_ends_is_started_again_with_growing_delays(tmp_path: Path) -> None:
    exits = Exits()

    async def scenario() -> Child:
        supervisor = Supervisor(tmp_path, exits)
        supervisor.start(row("print('once'); raise SystemExit(3)"))
        await until(lambda: len(exits.seen) >= 3)
        await supervisor.stop(1.0)
        return supervisor.children["child/0"]

    child = asyncio.run(scenario())
    assert exits.seen[:3] == [(3, FIRST_BACKOFF_S), (3, 2 * FIRST_BACKOFF_S), (3, 4 * FIRST_BACKOFF_S)]
    assert child.restarts == len(exits.seen) - 1
    assert log_of(tmp_path).count("once") == len(exits.seen)


def test_delays_have_a_ceiling(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deploy.launcher.supervisor.FIRST_BACKOFF_S", 0.01)
    monkeypatch.setattr("deploy.launcher.supervisor.LONGEST_BACKOFF_S", 0.03)
    exits = Exits()

    async def scenario() -> None:
        supervisor = Supervisor(tmp_path, exits)
        supervisor.start(row("raise SystemExit(3)"))
        await until(lambda: len(exits.seen) >= 4)
        await supervisor.stop(1.0)

    asyncio.run(scenario())
    assert [delay for _, delay in exits.seen[:4]] == [0.01, 0.02, 0.03, 0.03]
    assert LONGEST_BACKOFF_S == 4.0


def test_a_process_that_ran_steadily_starts_again_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deploy.launcher.supervisor.STEADY_S", 0.0)
    exits = Exits()

    async def scenario() -> None:
        supervisor = Supervisor(tmp_path, exits)
        supervisor.start(row("raise SystemExit(3)"))
        await until(lambda: len(exits.seen) >= 3)
        await supervisor.stop(1.0)

    asyncio.run(scenario())
    assert {delay for _, delay in exits.seen} == {FIRST_BACKOFF_S}


def test_a_killed_process_is_started_again(tmp_path: Path) -> None:
    exits = Exits()

    async def scenario() -> Child:
        supervisor = Supervisor(tmp_path, exits)
        supervisor.start(row(PATIENT))
        child = supervisor.children["child/0"]
        await until(lambda: log_of(tmp_path).count("up") == 1)
        assert child.process is not None
        child.process.kill()
        await until(lambda: log_of(tmp_path).count("up") == 2)
        await supervisor.stop(1.0)
        return child

    child = asyncio.run(scenario())
    assert exits.seen == [(-signal.SIGKILL, FIRST_BACKOFF_S)]
    assert child.restarts == 1


@pytest.mark.parametrize(
    ("code", "restarts", "refused"), [("raise SystemExit(2)", True, True), ("pass", False, False)]
)
def test_some_processes_are_not_started_again(code: str, restarts: bool, refused: bool, tmp_path: Path) -> None:
    exits = Exits()

    async def scenario() -> Child:
        supervisor = Supervisor(tmp_path, exits)
        supervisor.start(row(code, restarts=restarts))
        await until(lambda: bool(exits.seen))
        await supervisor.stop(1.0)
        return supervisor.children["child/0"]

    child = asyncio.run(scenario())
    assert exits.seen == [(2 if refused else 0, None)]
    assert (child.restarts, child.refused) == (0, refused)


def test_a_process_that_ignores_term_is_killed_after_the_grace(tmp_path: Path) -> None:
    exits = Exits()

    async def scenario() -> int:
        supervisor = Supervisor(tmp_path, exits)
        supervisor.start(row(STUBBORN, name="stubborn"))
        supervisor.start(row(PATIENT, name="patient"))
        await until(lambda: "up" in log_of(tmp_path, "stubborn") and "up" in log_of(tmp_path, "patient"))
        process = supervisor.children["stubborn/0"].process
        assert process is not None
        await supervisor.stop(0.3)
        return process.pid

    pid = asyncio.run(scenario())
    assert not is_running(pid)
    assert exits.seen == []


def test_a_process_that_is_asked_to_end_while_it_is_created_ends(tmp_path: Path) -> None:
    async def scenario() -> Child:
        supervisor = Supervisor(tmp_path, Exits())
        supervisor.start(row(PATIENT))
        await asyncio.sleep(0)  # the keeper has begun to create it
        await supervisor.stop(5.0)
        return supervisor.children["child/0"]

    assert asyncio.run(scenario()).process is None


def test_a_cancelled_supervisor_leaves_no_process(tmp_path: Path) -> None:
    async def scenario() -> int:
        supervisor = Supervisor(tmp_path, Exits())
        supervisor.start(row(STUBBORN))
        await until(lambda: "up" in log_of(tmp_path))
        process = supervisor.children["child/0"].process
        assert process is not None
        return process.pid

    pid = asyncio.run(scenario())
    deadline = time.monotonic() + 10.0
    while is_running(pid):
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_orders_reach_the_process_and_are_repeated_to_its_successor(tmp_path: Path) -> None:
    echo = "print('up', flush=True)\nfor _ in range(2): print('got', input(), flush=True)"

    async def scenario() -> None:
        supervisor = Supervisor(tmp_path, Exits())
        supervisor.start(row(echo, takes_orders=True))
        await until(lambda: "up" in log_of(tmp_path))
        supervisor.order("child/0", "land")
        supervisor.order("child/0", "stop")
        supervisor.order("nobody/0", "land")
        await until(lambda: log_of(tmp_path).count("up") >= 2 and log_of(tmp_path).count("got stop") >= 2)
        await supervisor.stop(1.0)

    asyncio.run(scenario())
    assert log_of(tmp_path).splitlines()[:6] == ["up", "got land", "got stop"] * 2


LAUNCHER = """
import asyncio, sys
from pathlib import Path
from deploy.launcher.process_table import ProcessRow
from deploy.launcher.supervisor import Supervisor

CHILD = (
    "import os, time; from shared.process import prepare_process; prepare_process('x');"
    "print(os.getpid()); time.sleep(600)"
)

async def main():
    supervisor = Supervisor(Path(sys.argv[1]), print)
    for n in (1, 2, 3):
        supervisor.start(ProcessRow(role="c", number=n, command=(sys.executable, "-c", CHILD)))
    await asyncio.sleep(600)

asyncio.run(main())
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks the Linux kernel for /proc")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_no_child_survives_the_death_of_its_launcher(number: signal.Signals, tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", LAUNCHER, str(tmp_path)]) as launcher:
        try:
            pids = [wait_for_pid(tmp_path / f"c-{n}.log") for n in (1, 2, 3)]
            assert all(map(is_running, pids))
            assert all(os.getsid(pid) == pid for pid in pids)
        finally:
            launcher.send_signal(number)
    deadline = time.monotonic() + 10.0
    while any(map(is_running, pids)):
        assert time.monotonic() < deadline
        time.sleep(0.02)


def wait_for_pid(log: Path) -> int:
    deadline = time.monotonic() + 30.0
    while not log.exists() or not log.read_text().endswith("\n"):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return int(log.read_text())
