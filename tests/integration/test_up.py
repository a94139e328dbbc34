"""`swarmtouch up` with real processes: the contract, and that nothing is ever left behind."""

import json
import os
import pty
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from deploy.launcher.supervisor import AT_ONCE
from shared.config import load_scenario
from shared.process import LAUNCHER_PID

pytestmark = [
    pytest.mark.parallel,
    pytest.mark.timeout(120),
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for processes in Linux's /proc"),
]

Launcher = subprocess.Popen[str]
STARTUP_S = 30.0
FLYING = "mode FOLLOW"


def children_of(launcher: int) -> list[int]:
    """Every live process that carries the launcher's number in its environment."""
    mark = f"{LAUNCHER_PID}={launcher}".encode()
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            environment = path.read_bytes()
        except OSError:  # it ended, or it is not ours
            continue
        if mark in environment.split(b"\0"):
            found.append(int(path.parent.name))
    return found


@contextmanager
def launched(runs: Path, *arguments: str, **options: Any) -> Iterator[Launcher]:
    command = [sys.executable, "-m", "deploy.cli", "up", "--runs", str(runs), *arguments]
    options = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    with subprocess.Popen(command, text=True, start_new_session=True, **options) as process:
        try:
            yield process
        finally:
            process.kill()


def until(condition: Callable[[], object], limit_s: float) -> None:
    deadline = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def ends_alone(launcher: int, limit_s: float = 5.0) -> None:
    until(lambda: not children_of(launcher), limit_s)


def wait_until_flying(process: Launcher) -> None:
    assert process.stderr is not None
    for line in process.stderr:
        if FLYING in line:
            return
    raise AssertionError("the launcher ended before anybody flew")


def test_a_flight_keeps_the_json_contract(tmp_path: Path) -> None:
    with launched(tmp_path, "rhombus", "--seconds", "12", "--json") as process:
        output, errors = process.communicate(timeout=100)
        assert process.returncode == 0, errors
    summary = json.loads(output.splitlines()[-1])
    assert len(output.splitlines()) == 1
    assert summary["ok"] is True
    assert summary["landed"] is True
    assert summary["seconds"] >= 12.0
    assert (summary["restarts"], summary["collisions"], summary["fence_exits"]) == (0, 0, 0)
    assert summary["min_distance_m"] > 0.3
    assert summary["min_hand_distance_m"] > 0.3
    assert [agent["id"] for agent in summary["agents"]] == [1, 2, 3, 4]
    for agent in summary["agents"]:
        assert 0.0 < agent["rate_hz"] < 121.0
        assert agent["steps"] == pytest.approx(agent["rate_hz"] * summary["seconds"], rel=0.3)
        assert 0.0 < agent["hand_used"] <= 1.0
        assert 0.0 < agent["on_time"] <= 1.0
        assert 0.0 < agent["tracking_rms_m"] < 1.0
        assert 0.0 < agent["latency_ms"]["p50"] <= agent["latency_ms"]["p99"]
        assert 0.0 < agent["cpu"] < 1.0
        assert 10.0 < agent["rss_mb"] < 500.0
    assert set(summary["formation"]["distances_m"]) == {"1-2", "1-3", "2-4", "3-4"}
    # One hop more is never faster.
    one, two, _, four = (agent["latency_ms"]["p50"] for agent in summary["agents"])
    assert one < two < four
    ends_alone(process.pid)

    run = tmp_path / "latest"
    assert json.loads((run / "summary.json").read_text()) == summary
    assert load_scenario(run / "scenario.toml").swarm.name == "rhombus"
    assert {path.name for path in (run / "logs").iterdir()} == {
        *(f"drone-{n}.log" for n in range(1, 5)),
        "relay.log",
        "world.log",
    }
    assert "landed" in errors
    assert "tracking" in errors or "RMS" in errors


def test_ctrl_c_lands(tmp_path: Path) -> None:
    with launched(tmp_path, "rhombus", "--json") as process:
        wait_until_flying(process)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
        assert process.returncode == 0, errors
    summary = json.loads(output.splitlines()[-1])
    assert summary["landed"] is True
    ends_alone(process.pid)


def test_a_flight_ends_with_its_hand(tmp_path: Path) -> None:
    hand = "scripted:hold?duration=3"
    with launched(tmp_path, "rhombus", "--hand", hand, "--json") as process:
        output, errors = process.communicate(timeout=100)
        assert process.returncode == 0, errors
    assert json.loads(output.splitlines()[-1])["ok"] is True


def test_more_than_start_at_a_time_are_all_in_formation_without_a_restart(tmp_path: Path) -> None:
    drones = AT_ONCE + 2
    arguments = ("grid", "--set", f"formation.n={drones}", "--set", "limits.takeoff_height=0.6", "--json")
    with launched(tmp_path, *arguments) as process:
        logs = [tmp_path / "latest" / "logs" / f"drone-{n}.log" for n in range(1, drones + 1)]
        until(lambda: all(log.exists() and "FOLLOW at" in log.read_text() for log in logs), 3 * STARTUP_S)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    summary = json.loads(output.splitlines()[-1])
    assert (summary["restarts"], summary["landed"]) == (0, True), errors
    assert all(agent["followed"] for agent in summary["agents"])


def test_a_hand_that_is_nowhere_makes_no_flight(tmp_path: Path) -> None:
    rows = [f"{k / 60},{(-1) ** k * 15},0,1.2" for k in range(120)]
    rows[60] = "1.0,,,"
    (tmp_path / "hand.csv").write_text("\n".join(["t,x,y,z", *rows]) + "\n", encoding="ascii")
    hand = f"recording:{tmp_path / 'hand.csv'}?lead=0"
    with launched(tmp_path, "rhombus", "--hand", hand, "--json") as process:
        output, errors = process.communicate(timeout=100)
    summary = json.loads(output.splitlines()[-1])
    assert (process.returncode, summary["ok"], summary["landed"]) == (1, False, True), errors
    assert summary["hand"]["rejected"] > 50
    said = "1 of 120 poses left out: 1 not a number (the first: line 62)"
    assert summary["hand"]["remarks"] == [said]
    assert errors.count(f"hand: {said}") == 2  # before the flight, and after it
    assert f"not ok: {summary['faults'][0]}" in errors
    log = (tmp_path / "latest" / "logs" / "relay.log").read_text()
    assert "in metres?" in log
    assert said in log


def test_a_second_interrupt_does_not_wait_for_the_landing(tmp_path: Path) -> None:
    with launched(tmp_path, "rhombus", "--json") as process:
        wait_until_flying(process)
        process.send_signal(signal.SIGTERM)
        assert process.stderr is not None
        for line in process.stderr:
            if "landing" in line:
                break
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=30)
        assert process.returncode == 1, errors
    assert json.loads(output.splitlines()[-1])["landed"] is False
    ends_alone(process.pid)


@pytest.mark.parametrize("moment", ["starting", "flying"])
def test_a_killed_launcher_leaves_no_process(moment: str, tmp_path: Path) -> None:
    with launched(tmp_path, "rhombus", "--json") as process:
        if moment == "flying":
            wait_until_flying(process)
        until(lambda: len(children_of(process.pid)) >= 5, STARTUP_S)
        process.kill()
        process.wait()
        ends_alone(process.pid, 10.0)


def test_a_killed_agent_is_started_again_and_the_flight_is_not_ok(tmp_path: Path) -> None:
    with launched(tmp_path, "rhombus", "--seconds", "14", "--json") as process:
        wait_until_flying(process)
        os.kill(pid_of("drone/3", process.pid), signal.SIGKILL)
        output, errors = process.communicate(timeout=100)
    summary = json.loads(output.splitlines()[-1])
    assert process.returncode == 1
    assert summary["ok"] is False
    assert summary["restarts"] == 1
    assert [agent["restarts"] for agent in summary["agents"]] == [0, 0, 1, 0]
    assert "drone-3 ended unexpectedly (SIGKILL); it starts again in 0.25 s" in errors


def pid_of(token: str, launcher: int) -> int:
    number = token.partition("/")[2].encode()
    for pid in children_of(launcher):
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        if b"--id" in words and words[words.index(b"--id") + 1] == number:
            return pid
    raise AssertionError(f"no process of {token}")


def test_the_space_bar_stops_and_the_terminal_is_restored(tmp_path: Path) -> None:
    keyboard, terminal = pty.openpty()
    stty = ["stty", "-g"]
    before = subprocess.run(stty, stdin=terminal, capture_output=True, check=True).stdout
    with launched(tmp_path, "rhombus", "--json", stdin=terminal) as process:
        wait_until_flying(process)
        assert subprocess.run(stty, stdin=terminal, capture_output=True, check=True).stdout != before
        os.write(keyboard, b" ")
        output, errors = process.communicate(timeout=60)
    assert "STOP" in errors
    assert json.loads(output.splitlines()[-1])["landed"] is False
    assert process.returncode == 1
    assert subprocess.run(stty, stdin=terminal, capture_output=True, check=True).stdout == before
    os.close(keyboard)
    os.close(terminal)


def test_a_reader_that_vanishes_does_not_end_the_flight(tmp_path: Path) -> None:
    with launched(tmp_path, "rhombus", "--hand", "scripted:hold?duration=7", "--json") as process:
        assert process.stderr is not None
        process.stderr.close()
        assert process.stdout is not None
        output = process.stdout.read()
        assert process.wait(60) == 0
    assert json.loads(output.splitlines()[-1])["ok"] is True


def test_a_reader_that_stalls_holds_nobody_up(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writing, b"x" * 65536)
    os.set_blocking(writing, True)
    with launched(tmp_path, "rhombus", "--json", stderr=writing) as process:
        logs = [tmp_path / "latest" / "logs" / f"drone-{n}.log" for n in range(1, 5)]
        until(lambda: all(log.exists() and "FOLLOW at" in log.read_text() for log in logs), STARTUP_S)
        process.send_signal(signal.SIGINT)
        assert process.stdout is not None
        assert json.loads(process.stdout.readline())["landed"] is True
        summary = tmp_path / "latest" / "summary.json"
        until(lambda: summary.exists() and summary.read_text().endswith("\n"), STARTUP_S)
        ends_alone(process.pid)
        os.close(writing)
        with os.fdopen(reading, "rb") as reader:
            text = reader.read()
        assert b"collisions" in text, "what was said waits for the reader"
        assert process.wait(60) == 0


def test_a_run_folder_that_vanishes_costs_neither_the_flight_nor_its_summary(tmp_path: Path) -> None:
    with launched(tmp_path, "rhombus", "--json") as process:
        wait_until_flying(process)
        run = (tmp_path / "latest").resolve()
        shutil.rmtree(run)
        run.write_text("no folder")
        os.kill(pid_of("drone/3", process.pid), signal.SIGKILL)
        assert process.stderr is not None
        for line in process.stderr:
            if "cannot be written again" in line:
                break
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    summary = json.loads(output.splitlines()[-1])
    assert summary["min_distance_m"] > 0.2, "by the world's last status"
    assert "drone-3 goes on without a log" in errors
    assert f"the summary above is not in {run / 'summary.json'}" in errors
    ends_alone(process.pid)


def test_a_configuration_that_a_process_refuses_ends_the_flight(tmp_path: Path) -> None:
    arguments = ("rhombus", "--json", "--set", "vehicles.robots.2.uri=warp://9")
    with launched(tmp_path, *arguments) as process:
        output, errors = process.communicate(timeout=60)
    assert process.returncode == 2
    assert output == ""
    assert "drone-2 refused to start" in errors.splitlines()[-1]
    assert "warp" in errors.splitlines()[-1]
    ends_alone(process.pid)
