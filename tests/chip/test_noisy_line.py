"""A bad line: 1 % of the bytes changed, lost or doubled, both ways, for 500 patterns on the serial link."""

import time
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from itertools import pairwise

import pytest

from glove_bridge.gloves.base import Outcome
from glove_bridge.gloves.serial_link import SerialLink
from glove_bridge.link_timing import USB
from glove_bridge.protocol import PlayFrame
from glove_bridge.session import Session
from tests.chip.simulated_chip import SimulatedChip

pytestmark = [pytest.mark.chip, pytest.mark.parallel, pytest.mark.timeout(400)]

PATTERNS = 500
FRAME_MS = 30
SLACK_MS = 2.0
REST = (0,) * 5


def duties(k: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Returns both frames of pattern k, which say k."""
    low, high = 1 + k % 250, 1 + k // 250
    return (low, high, 0, 0, 0), (0, 0, 0, high, low)


def play(link: SerialLink, k: int) -> Outcome:
    frames = tuple(PlayFrame(FRAME_MS, each) for each in duties(k))

    def order(session: Session, now_ns: int) -> None:
        session.play(frames, now_ns)

    link.order(order)
    until = time.monotonic() + 20.0
    while time.monotonic() < until:
        for report in link.reports():
            if report.outcome is not Outcome.STARTED:
                return report.outcome
        time.sleep(0.001)
    raise AssertionError(f"pattern {k} was lost without a word")


def connected(link: SerialLink) -> bool:
    until = time.monotonic() + 10.0
    while not link.connected and time.monotonic() < until:
        time.sleep(0.001)
    return link.connected


def test_no_pattern_is_lost_without_a_word_and_no_motor_left_on(
    start_chip: Callable[..., SimulatedChip],
) -> None:
    chip = start_chip("--noise", "0.01", "--seed", "7")
    outcomes = {}
    with closing(SerialLink(str(chip.path), USB)) as link:
        for k in range(PATTERNS):
            assert connected(link)
            outcomes[k] = play(link, k)
        retries = link.session.retries
    chip.wait(lambda chip: not chip.turning)
    steps = chip.steps

    # Nothing plays but what was asked for, and that at most once.
    asked = {each: k for k in range(PATTERNS) for each in duties(k)}
    seen = Counter(step.duties for step in steps if step.duties != REST)
    assert set(seen) <= set(asked)
    assert set(seen.values()) == {1}

    # What was reported as played was played whole.
    ends = {a.duties: b.ms - a.ms for a, b in pairwise(steps)}
    played = [k for k, outcome in outcomes.items() if outcome is Outcome.FINISHED]
    for k in played:
        assert [ends[each] for each in duties(k)] == pytest.approx([FRAME_MS, FRAME_MS], abs=SLACK_MS)
    # And what failed was cut short at most.
    assert all(ends[each] <= FRAME_MS + SLACK_MS for each in seen)

    assert Counter(outcomes.values()).keys() <= {Outcome.FINISHED, Outcome.FAILED}
    assert len(played) >= 0.9 * PATTERNS
    assert retries > 50
    print(f"{len(played)} of {PATTERNS} played, the rest reported; {retries} repetitions")
