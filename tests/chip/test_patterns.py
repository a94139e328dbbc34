"""From a pattern to the pins: every pattern of every set, through the serial glove, on the simulated chip."""

import time
from collections.abc import Callable
from contextlib import closing
from itertools import groupby, pairwise

import pytest

from glove_bridge.calibration import device_frames
from glove_bridge.calibration_file import load_calibration
from glove_bridge.gloves import open_glove
from glove_bridge.gloves.base import Glove, Outcome
from glove_bridge.patterns import load_patterns, shipped_sets
from glove_bridge.patterns.pattern import Pattern
from glove_bridge.protocol import Set
from tests.chip.asker import Asker
from tests.chip.simulated_chip import SimulatedChip

pytestmark = [pytest.mark.chip, pytest.mark.parallel]

FRAME_MS = 2.0
"""How far a frame may be from its length."""


def until(condition: Callable[[], bool], timeout_s: float) -> None:
    end = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end, f"{timeout_s} s in vain"
        time.sleep(0.002)


def play(glove: Glove, pattern: Pattern) -> list[Outcome]:
    outcomes: list[Outcome] = []

    def ended() -> bool:
        outcomes.extend(report.outcome for report in glove.poll(time.monotonic_ns()))
        return bool(outcomes) and outcomes[-1] is not Outcome.STARTED

    glove.play(pattern, time.monotonic_ns())
    until(ended, 10.0)
    return outcomes


def expected_steps(pattern: Pattern) -> list[tuple[int, tuple[int, ...]]]:
    """Returns length and duties of what should be seen, frames of the same duties as one."""
    frames = groupby(device_frames(pattern, load_calibration(None)), key=lambda frame: frame.duties)
    return [(sum(frame.ms for frame in same), duties) for duties, same in frames]


@pytest.mark.parametrize("name", shipped_sets())
def test_every_pattern_arrives_with_its_fingers_duties_and_times(name: str, chip: SimulatedChip) -> None:
    with closing(open_glove(chip.uri)) as glove:
        until(lambda: glove.connected, 5.0)
        played: list[tuple[int, ...]] = []
        for pattern in load_patterns(name).patterns.values():
            assert play(glove, pattern) == [Outcome.STARTED, Outcome.FINISHED], pattern.name
            expected = expected_steps(pattern)
            before = len(played)
            played += [*(duties for _, duties in expected), (0,) * 5]
            chip.expect(*played)
            seen = chip.steps[before:]
            assert [b.ms - a.ms for a, b in pairwise(seen)] == pytest.approx(
                [ms for ms, _ in expected], abs=FRAME_MS
            )
            fingers = set().union(*(frame.hz for frame in pattern.frames))
            assert fingers == {k + 1 for step in seen for k, duty in enumerate(step.duties) if duty}


def test_the_pins_are_high_for_what_the_registers_say(chip: SimulatedChip) -> None:
    duties = (10, 64, 127, 191, 254)
    with Asker(chip.path) as asker:
        asker.greet(deadman_ms=1000)
        asker.tell(Set(1, duties))
        chip.wait(lambda chip: len(chip.drives) == 10)
    on, off = chip.drives[:5], chip.drives[5:]
    for start, end, duty in zip(on, off, duties, strict=True):
        share = (end.high_ms - start.high_ms) / (end.ms - start.ms)
        # simavr's 16-bit timer is 3 % off.
        assert share == pytest.approx((duty + 1) / 256, rel=0.05)


@pytest.mark.parametrize(("duties", "high"), [((0,) * 5, 0.0), ((255,) * 5, 1.0)])
def test_off_and_full_are_constant(duties: tuple[int, ...], high: float, chip: SimulatedChip) -> None:
    with Asker(chip.path) as asker:
        asker.greet()
        asker.tell(Set(1, (128,) * 5))
        asker.tell(Set(2, duties))
        asker.tell(Set(3, (128,) * 5))
    chip.expect((128,) * 5, duties, (128,) * 5, (0,) * 5)
    for motor in range(1, 6):
        _, start, end, _ = (drive for drive in chip.drives if drive.motor == motor)
        # One period, 1.02 ms, may be under way at either end.
        assert end.high_ms - start.high_ms == pytest.approx(high * (end.ms - start.ms), abs=1.1)
