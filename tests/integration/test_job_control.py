"""`swarmtouch up` in a shell with job control: Ctrl-Z and `fg`, `&`, a window that is closed."""

import json
import time
from pathlib import Path

import pytest

from tests.integration.children import is_running
from tests.integration.shell import BASH, CTRL_Z, PROMPT, shell

pytestmark = [pytest.mark.timeout(120), pytest.mark.skipif(not BASH.exists(), reason="types into bash")]

FLY = "swarmtouch up rhombus --no-live --set limits.takeoff_height=0.3"
FLYING = "mode FOLLOW"


def summary_of(folder: Path) -> dict[str, object]:
    """The summary, once it is whole."""
    path = folder / "runs" / "latest" / "summary.json"
    deadline = time.monotonic() + 60.0
    while not path.exists() or not path.read_text().endswith("\n"):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    summary: dict[str, object] = json.loads(path.read_text())
    return summary


def test_what_was_started_in_a_shell_ends_with_it(tmp_path: Path) -> None:
    with shell(tmp_path) as terminal:
        terminal.type("sleep 600 & echo started $!.\n")
        terminal.until("\nstarted ")
        pid = int(terminal.until("."))
        assert is_running(pid)
    deadline = time.monotonic() + 10.0
    while is_running(pid):
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_ctrl_z_lands_before_it_stops_and_fg_brings_flight_and_keys_back(tmp_path: Path) -> None:
    with shell(tmp_path) as terminal:
        terminal.type(f"{FLY}\n")
        terminal.until(FLYING)
        terminal.type(CTRL_Z)
        terminal.until("everybody is down")
        terminal.until("Stopped")
        terminal.until(PROMPT)
        terminal.type("fg\n")
        terminal.until(FLYING)
        terminal.type(" ")
        terminal.until("launcher | STOP")
        terminal.until("not ok: it was ended by STOP: the motors of drones 1, 2, 3, 4 were cut")
        terminal.until(PROMPT)
        terminal.type("stty -a\n")
        assert " icanon" in terminal.until(PROMPT)


def test_a_flight_in_the_background_needs_no_terminal(tmp_path: Path) -> None:
    with shell(tmp_path) as terminal:
        terminal.type(f"stty tostop; {FLY} --hand 'scripted:hold?duration=4' > out 2> err &\n")
        summary = summary_of(tmp_path)
        assert summary["ok"] is True
        terminal.type("wait; echo ended\n")
        terminal.until("Done")
        terminal.until("\nended")


def test_keys_work_when_a_flight_comes_to_the_foreground(tmp_path: Path) -> None:
    with shell(tmp_path) as terminal:
        terminal.type(f"{FLY} &\n")
        terminal.until(FLYING)
        terminal.type("fg\n")
        terminal.until(f"\n{FLY}")
        terminal.until(FLYING)
        terminal.type(" ")
        terminal.until("launcher | STOP")
        terminal.until(PROMPT)


def test_a_closed_window_lands_and_keeps_the_summary_and_the_recording(tmp_path: Path) -> None:
    with shell(tmp_path) as terminal:
        terminal.type(f"{FLY} --record\n")
        terminal.until(FLYING)
        terminal.hang_up()
        summary = summary_of(tmp_path)
    assert summary["ok"] is True
    assert summary["landed"] is True
