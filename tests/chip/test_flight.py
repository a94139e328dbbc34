"""Whole flights with the firmware on a simulated chip as their glove: the summary, and a loose plug."""

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from glove_bridge.patterns import load_patterns
from tests.chip.simulated_chip import SimulatedChip
from tests.integration.floor import Floor
from tests.integration.test_up import Launcher, launched, wait_until_flying
from tests.replay.flights import busiest_flight

pytestmark = [pytest.mark.chip, pytest.mark.timeout(180)]

LATENCY_MS = 20.0
"""Where the machine lets everybody run."""
RECOVERY_MS = 3_000.0
BOOTLOADER_MS = 1_600
"""As long as the bootloader of an UNO waits for a new program after every opening of the port."""


def fly(process: Launcher) -> tuple[dict[str, Any], Floor]:
    """Waits for the end of a flight; returns its summary, and what the machine gave meanwhile."""
    with Floor() as floor:
        output, errors = process.communicate(timeout=150)
    assert process.returncode == 0, errors
    summary: dict[str, Any] = json.loads(output.splitlines()[-1])
    assert summary["ok"]
    assert (summary["restarts"], summary["collisions"], summary["fence_exits"]) == (0, 0, 0)
    for agent in summary["agents"]:
        assert agent["hand_used"] > 0.7 * floor.slowest_share()
        assert agent["rate_hz"] > 40.0 * floor.slowest_share()
    return summary, floor


def felt_in(summary: dict[str, Any], patterns: str) -> dict[str, Any]:
    """Leaves out the cues: one may begin when the drones' processes end, just before the bridge's own."""
    names, glove = load_patterns(patterns).patterns, summary["glove"]
    counts = {
        outcome: {name: count for name, count in glove[outcome].items() if name in names}
        for outcome in ("played", "delivered", "failed", "lost")
    }
    return {**glove, **counts}


def test_the_summary_of_a_recorded_flight_tells_what_was_felt(chip: SimulatedChip, tmp_path: Path) -> None:
    hand = f"recording:{busiest_flight(30.0)}"
    arguments = ("--hand", hand, "--seconds", "30", "--glove", chip.uri, "--patterns", "flight", "--json")
    with launched(tmp_path / "runs", "maze", *arguments) as process:
        summary, floor = fly(process)
    glove = felt_in(summary, "flight")
    assert glove["uri"] == chip.uri
    delivered = sum(glove["delivered"].values())
    assert delivered >= 5
    assert (glove["lost"], glove["failed"]) == ({}, {})
    assert glove["played"] == glove["delivered"]
    assert 0.0 < glove["latency_ms"]["p50"] <= LATENCY_MS + 2.0 * floor.late_ms()
    # Every pattern ends with all motors at rest.
    assert sum(not any(step.duties) for step in chip.steps) >= delivered
    assert not chip.turning


def test_unplugged_in_a_pattern_the_glove_comes_back_and_the_flight_goes_on(
    start_chip: Callable[..., SimulatedChip], tmp_path: Path
) -> None:
    chip = start_chip("--boot-ms", str(BOOTLOADER_MS))
    arguments = ("--seconds", "25", "--glove", chip.uri, "--patterns", "paper", "--json")
    with launched(tmp_path, "rhombus", *arguments) as process:
        wait_until_flying(process)
        chip.wait(lambda chip: chip.turning and len(chip.steps) > 1, 30.0)
        unplugged_ms = chip.do("unplug")
        plugged_ms = chip.do("plug")
        chip.wait(lambda chip: any(ms > plugged_ms for ms in chip.times("said")), 30.0)
        answered_ms = next(ms for ms in chip.times("said") if ms > plugged_ms)
        chip.wait(lambda chip: chip.turning, 30.0)
        felt_again_ms = chip.steps[-1].ms
        summary, _ = fly(process)
    glove = felt_in(summary, "paper")
    assert answered_ms - plugged_ms <= RECOVERY_MS
    on = [step for step in chip.steps if any(step.duties)]
    assert not [step for step in on if unplugged_ms < step.ms < answered_ms]
    assert answered_ms < felt_again_ms
    assert next(step for step in chip.steps if step.ms >= unplugged_ms - 0.01).duties == (0,) * 5
    # Whatever was asked for without a glove is lost; the pattern that was cut short had been delivered.
    cut_short = Counter(glove["failed"]) - Counter(glove["lost"])
    assert cut_short.total() == 1
    assert Counter(glove["delivered"]) == Counter(glove["played"]) + cut_short
    assert not chip.turning
