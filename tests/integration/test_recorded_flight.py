"""A recorded human hand through the recorded columns, with real processes."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.integration.floor import Floor
from tests.replay.flights import a_flight, read_json

LEAST_USED = 0.98
"""Of the hand's samples, where the machine lets everybody run."""
"""Fraction of the hand's samples that a step uses on a busy machine; idle, it is 1 (docs/performance.md)."""


@pytest.mark.timeout(120)
def test_the_maze_is_flown_by_the_recorded_hand(tmp_path: Path) -> None:
    folder = a_flight("visual")
    hand = f"recording:{folder}"
    command = [
        sys.executable,
        "-m",
        "deploy.cli",
        "up",
        "maze",
        "--hand",
        hand,
        "--runs",
        str(tmp_path),
        "--json",
    ]
    with Floor() as floor:
        done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout.splitlines()[-1])
    assert summary["ok"] is True
    assert (summary["collisions"], summary["fence_exits"], summary["restarts"]) == (0, 0, 0)
    assert [agent["id"] for agent in summary["agents"]] == [1, 2, 3]
    for agent in summary["agents"]:
        assert agent["hand_used"] >= LEAST_USED * floor.slowest_share(), agent
        assert agent["steps"] > 40.0 * read_json(folder)["duration_s"]
    assert "Traceback" not in "".join(path.read_text() for path in tmp_path.glob("*/logs/*.log"))
