"""The supervisor when something is in its way: crowds, late orders, deleted folders, no descriptors."""

import asyncio
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.launcher.supervisor import AT_ONCE, FIRST_BACKOFF_S, Child, Supervisor
from shared.process import EXIT_REFUSED
from tests.integration.children import PATIENT, Exits, log_of, row, until

pytestmark = pytest.mark.parallel


def test_orders_given_before_the_start_reach_the_process(tmp_path: Path) -> None:
    async def scenario() -> None:
        supervisor = Supervisor(tmp_path, Exits())
        supervisor.order("child/0", "stop")
        supervisor.start(row("print('got', input(), flush=True); input()", takes_orders=True))
        await until(lambda: "got stop" in log_of(tmp_path))
        await supervisor.stop(1.0)

    asyncio.run(scenario())


def test_an_order_ends_the_wait_for_the_next_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deploy.launcher.supervisor.FIRST_BACKOFF_S", 3600.0)
    exits = Exits()

    async def scenario() -> None:
        supervisor = Supervisor(tmp_path, exits)
        supervisor.start(row("print('up', flush=True); print('got', input(), flush=True)", takes_orders=True))
        await until(lambda: "up" in log_of(tmp_path))
        process = supervisor.children["child/0"].process
        assert process is not None
        process.kill()
        await until(lambda: bool(exits.seen))
        supervisor.order("child/0", "stop")
        await until(lambda: "got stop" in log_of(tmp_path))
        await supervisor.stop(1.0)

    asyncio.run(scenario())


def test_what_is_many_starts_a_few_at_a_time_and_the_relay_waits_for_nobody(tmp_path: Path) -> None:
    up: set[str] = set()

    async def scenario() -> None:
        supervisor = Supervisor(tmp_path, Exits(), is_up=up.__contains__)

        def started() -> int:
            return sum(child.starts for child in supervisor.children.values())

        for number in range(2 * AT_ONCE + 3):
            supervisor.start(row(PATIENT, name=f"c{number}"))
        await until(lambda: started() == AT_ONCE)
        supervisor.start(row(PATIENT, name="relay", takes_orders=True))
        await until(lambda: supervisor.children["relay/0"].starts == 1)
        assert started() == AT_ONCE + 1
        await until(lambda: supervisor.awaited)
        up.update({"c0/0", "c1/0", "c2/0"})
        await until(lambda: started() == AT_ONCE + 4)
        up.update(supervisor.children)
        await until(lambda: started() == 2 * AT_ONCE + 4)
        assert not supervisor.awaited
        assert not supervisor.missing
        up.remove("c5/0")
        assert supervisor.missing == ["c5/0"]
        await supervisor.stop(1.0)

    asyncio.run(scenario())


def test_who_never_comes_to_work_is_not_waited_for_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deploy.launcher.supervisor.ARRIVAL_S", 0.05)

    async def scenario() -> None:
        supervisor = Supervisor(tmp_path, Exits(), is_up=lambda _: False)
        for number in range(AT_ONCE + 1):
            supervisor.start(row(PATIENT, name=f"c{number}"))
        supervisor.start(row("pass", name="short", restarts=False))
        await until(lambda: not supervisor.awaited)
        assert all(child.starts == 1 for child in supervisor.children.values())
        assert len(supervisor.missing) == AT_ONCE + 2
        await supervisor.stop(1.0)

    asyncio.run(scenario())


def test_a_run_folder_that_is_deleted_in_flight_costs_no_restart(tmp_path: Path) -> None:
    logs, file, said = tmp_path / "run" / "logs", tmp_path / "run" / "scenario.toml", list[str]()
    exits = Exits()

    async def scenario() -> None:
        supervisor = Supervisor(logs, exits, say=said.append, files={file: "text"})
        supervisor.start(row(f"print(open({str(file)!r}).read(), flush=True); input()", takes_orders=True))
        await until(lambda: "text" in log_of(logs))
        shutil.rmtree(tmp_path / "run")
        supervisor.order("child/0", "end")
        await until(lambda: "text" in log_of(logs))
        await supervisor.stop(1.0)

    asyncio.run(scenario())
    assert exits.seen[0] == (0, FIRST_BACKOFF_S)
    assert said[:2] == [f"{file} was gone, and has been written again"] * 2


def test_without_a_place_for_the_log_the_process_runs_and_it_is_said(tmp_path: Path) -> None:
    logs, said = tmp_path / "logs", list[str]()
    logs.write_text("no folder")
    done = tmp_path / "done"

    async def scenario() -> None:
        supervisor = Supervisor(logs, Exits(), say=said.append)
        supervisor.start(row(f"print('lost'); open({str(done)!r}, 'w')"))
        await until(done.exists)
        await supervisor.stop(1.0)

    asyncio.run(scenario())
    assert "child goes on without a log" in said[0]
    assert "logs" in said[0]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="counts descriptors in Linux's /proc")
def test_without_descriptors_starts_are_tried_again_and_orders_go_through(tmp_path: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", POOR, str(tmp_path)], stdout=subprocess.PIPE, text=True
    ) as launcher:
        output, _ = launcher.communicate(timeout=60)
    lines = output.splitlines()
    assert "child cannot be started: [Errno 24] Too many open files" in lines[0]
    assert lines[-1] == "started again"
    assert "got stop" in log_of(tmp_path, "relay")


POOR = """
import asyncio, os, resource, sys
from pathlib import Path
from deploy.launcher.supervisor import Supervisor
from tests.integration.children import PATIENT, Exits, log_of, row, until

async def main(logs):
    said = []
    supervisor = Supervisor(logs, Exits(), say=said.append)
    supervisor.start(row("print('got', input(), flush=True); input()", name="relay", takes_orders=True))
    supervisor.start(row(PATIENT))
    await until(lambda: all(child.process for child in supervisor.children.values()))
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (len(os.listdir("/proc/self/fd")) - 1, hard))
    child = supervisor.children["child/0"]
    child.process.kill()
    await until(lambda: len(said) >= 1)
    supervisor.order("relay/0", "stop")
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    await until(lambda: child.starts == 2 and "got stop" in log_of(logs, "relay"))
    print(*said, "started again", sep="\\n")
    await supervisor.stop(1.0)

asyncio.run(main(Path(sys.argv[1])))
"""


@pytest.mark.parametrize("first", [0, EXIT_REFUSED])
def test_only_a_first_start_that_is_refused_is_final(first: int, tmp_path: Path) -> None:
    mark, exits = tmp_path / "mark", Exits()
    code = (
        f"import pathlib; mark = pathlib.Path({str(mark)!r}); again = mark.exists(); mark.touch()\n"
        f"raise SystemExit({EXIT_REFUSED} if again else {first})"
    )

    async def scenario() -> Child:
        supervisor = Supervisor(tmp_path, exits)
        supervisor.start(row(code))
        await until(lambda: len(exits.seen) >= (1 if first == EXIT_REFUSED else 3))
        await supervisor.stop(1.0)
        return supervisor.children["child/0"]

    child = asyncio.run(scenario())
    assert child.refused is (first == EXIT_REFUSED)
    delays = [delay for _, delay in exits.seen]
    assert delays == [None] if child.refused else None not in delays
