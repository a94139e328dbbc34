"""Plays patterns on a glove, one after the other, as fast as it takes them."""

import time
from contextlib import closing
from typing import NamedTuple

from glove_bridge.gloves.base import Glove, Outcome
from glove_bridge.patterns.pattern import Pattern, PatternSet
from shared.clock import NS_PER_S, Clock, system_clock


class Played(NamedTuple):
    """How a pattern went.

    Attributes:
        outcome: `FINISHED` or `FAILED`.
        started_ms: From the wish to the first frame, ms; None if it did not start.
        why: Of a failure.
    """

    outcome: Outcome
    started_ms: float | None
    why: str = ""


def play(glove: Glove, pattern: Pattern, clock: Clock) -> Played:
    """Plays one pattern to its end."""
    asked_ns = clock()
    glove.play(pattern, asked_ns)
    started_ms: float | None = None
    while True:
        for report in glove.poll(clock()):
            if report.outcome is not Outcome.STARTED:
                return Played(report.outcome, started_ms, report.why)
            started_ms = (report.at_ns - asked_ns) / 1e6
        next_ns = glove.next_ns()
        if next_ns is not None:
            time.sleep(max(0.0, (next_ns - clock()) / NS_PER_S))


def play_set(glove: Glove, patterns: PatternSet) -> list[Played]:
    """Plays every pattern, with the rest between two that its gate asks for, and closes the glove."""
    clock, played = system_clock(), []
    with closing(glove):
        for pattern in patterns.patterns.values():
            start_ns = clock()
            played.append(play(glove, pattern, clock))
            time.sleep(max(0.0, pattern.gate_ms / 1000.0 - (clock() - start_ns) / NS_PER_S))
    return played


def tell(pattern: Pattern, played: Played) -> int:
    """Says how a pattern went, and returns the exit code for that."""
    begun = "never started" if played.started_ms is None else f"started after {played.started_ms:.1f} ms"
    why = f": {played.why}; see docs/glove.md, first evening" if played.why else ""
    print(f"{pattern.name}: {begun}, {played.outcome}{why}")
    return 0 if played.outcome is Outcome.FINISHED else 1
