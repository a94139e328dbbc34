"""Five fingers below the status table, drawn from the pattern events; and what could not be felt by them."""

from collections import Counter
from collections.abc import Mapping

from glove_bridge.bridge import GLOVE_THERE
from glove_bridge.gloves.terminal import draw
from glove_bridge.patterns import CUES, load_patterns
from glove_bridge.patterns.pattern import Frame, Pattern
from shared.clock import Clock, system_clock
from shared.messages import PatternEvent, ProcessStatus

_NS_PER_MS = 1_000_000


class GlovePanel:
    """Shows what is on the glove now.

    Args:
        patterns: Name or file of the pattern set that the bridge uses.
        clock: The launcher's clock; it agrees with the bridge's, on the same machine.

    Raises:
        ConfigError: The pattern set is refused.
    """

    def __init__(self, patterns: str, clock: Clock | None = None) -> None:
        self._patterns = {**load_patterns(CUES).patterns, **load_patterns(patterns).patterns}
        self._clock = clock or system_clock()
        self._cues = frozenset(load_patterns(CUES).patterns)
        self._failed: Counter[str] = Counter()
        self._is_there = True

    def line(self, latest: PatternEvent | None) -> str:
        """Draws the fingers and names the pattern.

        Args:
            latest: The last event of a pattern that reached the glove.
        """
        pattern = self._patterns.get(latest.pattern) if latest else None
        if latest is None or pattern is None:
            return f"glove  {draw(None)}"
        playing = latest.outcome == "started"
        frame = _frame_at(pattern, self._clock() - latest.started_ns) if playing else None
        return f"glove  {draw(frame)}  {latest.pattern} {'' if frame else latest.outcome}".rstrip()

    def unfelt(self, failed: Mapping[str, int], status: ProcessStatus | None) -> list[str]:
        """Says what the operator has to be told otherwise, because it cannot be felt.

        Args:
            failed: How many patterns have failed so far, by name.
            status: The newest health of the bridge, None before the first.

        Returns:
            News since the last call: whether there is a glove, and the safety cues that it has not played.
        """
        news = []
        is_there = status is None or status.metrics.get(GLOVE_THERE, 1.0) > 0.0
        if is_there != self._is_there:
            self._is_there = is_there
            news.append("the glove can be felt" if is_there else "the glove cannot be felt: see bridge.log")
        news += [
            f"NOT FELT: {name.lower().replace('_', ' ')}"
            for name in sorted(self._cues)
            if failed.get(name, 0) > self._failed[name]
        ]
        self._failed = Counter(failed)
        return news


def _frame_at(pattern: Pattern, elapsed_ns: int) -> Frame | None:
    """Returns the frame that is on after so much time, None before the first and after the last."""
    end_ns = 0
    for frame in pattern.frames:
        end_ns += frame.ms * _NS_PER_MS
        if 0 <= elapsed_ns < end_ns:
            return frame
    return None
