"""A recorded hand flies the maze with a recording glove: patterns come, quickly, and the summary lists them."""

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from glove_bridge.patterns import load_patterns
from shared.config import load_scenario
from shared.messages import FormationState, PatternEvent
from tests.integration.bridged import BridgeListener
from tests.integration.recorder import START_S, Recorder
from tests.replay.flights import busiest_flight

pytestmark = pytest.mark.timeout(150)

SECONDS = 32.0
"""The recorded hand meets the first obstacles after about 25 s."""
LATENCY_MS = 10.0
"""Where the machine lets everybody run."""
PERIOD_MS = 20.0
"""A little more than between two states of a drone."""


def test_patterns_come_quickly_and_the_summary_lists_them(tmp_path: Path) -> None:
    hand, glove = busiest_flight(SECONDS), tmp_path / "glove.jsonl"
    command = [sys.executable, "-m", "deploy.cli", "up", "maze", "--hand", f"recording:{hand}", "--json"]
    command += ["--glove", f"record://{glove}", "--patterns", "flight-2018", "--runs", str(tmp_path)]
    file = tmp_path / "latest" / "scenario.toml"
    with (
        (tmp_path / "launcher.log").open("wb") as log,
        subprocess.Popen([*command, "--seconds", f"{SECONDS}"], stdout=subprocess.PIPE, stderr=log) as launcher,
    ):
        try:
            wait_for(file, launcher)
            scenario = load_scenario(file)
            with Recorder(scenario) as recorder, closing(BridgeListener(scenario)) as listener:
                recorder.until(lambda: launcher.poll() is not None, SECONDS + 2 * START_S)
                listener.drain()
            assert launcher.stdout is not None
            summary = json.loads(launcher.stdout.read().splitlines()[-1])
        finally:
            launcher.kill()
    frames = [json.loads(line) for line in glove.read_text().splitlines()]
    begun = [event for event in listener.events if event.outcome == "started"]
    assert len(begun) >= 3
    assert [f["pattern"] for f in frames if f["frame"] == 0] == [event.pattern for event in begun]
    assert [f["t_ns"] for f in frames if f["frame"] == 0] == [event.started_ns for event in begun]
    check_summary(summary, listener)
    first, last = listener.states[0], listener.states[-1]
    assert 15.0 * recorder.floor.slowest_share() < rate_hz(first, last) < 25.0
    latency = [latency_ms(recorder, event) for event in brought_by_a_state(begun)]
    print(f"{summary['glove']}; from the drone's step: p50 {np.median(latency):.1f}, max {max(latency):.1f} ms")
    assert np.median(latency) <= LATENCY_MS + 2.0 * recorder.floor.late_ms()
    assert summary["landed"]
    bridge_log = (tmp_path / "latest/logs/bridge.log").read_text()
    assert "Traceback" not in bridge_log


def rate_hz(first: FormationState, last: FormationState) -> float:
    return (last.seq - first.seq) * 1e9 / (last.stamp_ns - first.stamp_ns)


def wait_for(file: Path, launcher: "subprocess.Popen[bytes]") -> None:
    deadline = time.monotonic() + START_S
    while not (file.exists() and file.read_text()):
        assert launcher.poll() is None, "the launcher ended before it flew"
        assert time.monotonic() < deadline
        time.sleep(0.02)


def check_summary(summary: dict[str, dict[str, object]], listener: BridgeListener) -> None:
    glove = summary["glove"]
    for outcome, key in (("finished", "played"), ("suppressed", "suppressed"), ("failed", "failed")):
        names = [event.pattern for event in listener.events if event.outcome == outcome]
        assert glove[key] == {name: names.count(name) for name in names}
    assert glove["patterns"] == "flight-2018"
    published = {state.seq for state in listener.states}
    assert {event.state_seq for event in listener.events if event.outcome == "started"} <= published


def brought_by_a_state(begun: Sequence[PatternEvent]) -> list[PatternEvent]:
    """Leaves out patterns that only waited for the gate: they begin when it opens, between two states."""
    patterns = load_patterns("flight-2018").patterns
    kept = list(begun[:1])
    for before, event in pairwise(begun):
        gate_ms = patterns[before.pattern].gate_ms if before.pattern in patterns else 0
        # A state without a side closes the gate again for as long.
        waited_ms = (event.started_ns - before.started_ns) / 1e6
        if waited_ms > 2 * gate_ms + PERIOD_MS:
            kept.append(event)
    return kept


def latency_ms(recorder: Recorder, event: PatternEvent) -> float:
    """From the step of the newest drone that brought a pattern about to its first frame, ms.

    All processes run on one machine, so their clocks agree.
    """
    ((key, heard),) = [(key, heard) for key, heard in event.heard.items() if key.startswith("drone/")]
    states = recorder.states[int(key.split("/")[1])]
    (step_ns,) = [s.step_ns for s in states if (s.epoch, s.seq) == (heard.epoch, heard.seq)]
    return (event.started_ns - step_ns) / 1e6
