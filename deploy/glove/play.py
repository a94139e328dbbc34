"""Plays a pattern set on the terminal, one pattern after the other."""

import time

from glove_bridge.gloves.terminal import TerminalGlove
from glove_bridge.patterns.pattern import PatternSet
from shared.clock import NS_PER_S, system_clock


def play_set(patterns: PatternSet) -> None:
    """Plays every pattern at its own pace, with the rest between two that its gate asks for."""
    glove, clock = TerminalGlove(), system_clock()
    try:
        for pattern in patterns.patterns.values():
            start_ns = clock()
            glove.play(pattern, start_ns)
            while (next_ns := glove.next_ns()) is not None:
                time.sleep(max(0.0, (next_ns - clock()) / NS_PER_S))
                glove.poll(clock())
            time.sleep(max(0.0, pattern.gate_ms / 1000.0 - (clock() - start_ns) / NS_PER_S))
    finally:
        glove.close()
