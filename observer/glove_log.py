"""What the operator felt, from the pattern events alone: messages in, numbers out; no clock, no I/O."""

from collections import Counter

from observer.histogram import Histogram
from shared.messages import PatternEvent
from shared.plain_text import plain
from shared.topics import DRONE_STATE

LONGEST_NAME, MOST_NAMES = 24, 64
"""Names of patterns are shorter and fewer; anybody may say others."""
OTHERS = "others"

_DRONE = DRONE_STATE.pattern.split("{", maxsplit=1)[0]


class GloveLog:
    """Counts pattern events.

    Attributes:
        latest: The last event of a pattern that reached the glove, None before the first.
        played: Patterns that have ended, by name.
        delivered: Patterns that have started: a device has acknowledged them, by name.
        suppressed: Patterns that were wished for while the glove was busy, by name.
        failed: Patterns that did not start or were cut short, by name.
        lost: Those of them that did not start, by name.
        latency_ms: From the arrival of the newest drone state that brought a pattern about to its first frame,
            which a device tells by its acknowledgement.
    """

    def __init__(self) -> None:
        self.latest: PatternEvent | None = None
        self.played: Counter[str] = Counter()
        self.delivered: Counter[str] = Counter()
        self.suppressed: Counter[str] = Counter()
        self.failed: Counter[str] = Counter()
        self.lost: Counter[str] = Counter()
        self.latency_ms = Histogram()
        self._names: set[str] = set()

    def add(self, event: PatternEvent) -> None:
        """Takes the next event."""
        counts = {
            "started": self.delivered,
            "finished": self.played,
            "suppressed": self.suppressed,
            "failed": self.failed,
        }
        name = self._named(event.pattern)
        if event.outcome in counts:
            counts[event.outcome][name] += 1
        if event.outcome == "started":
            self._add_latency(event)
        if event.outcome == "failed" and event.started_ns == 0:
            self.lost[name] += 1
        if event.outcome != "suppressed":
            self.latest = event

    def _named(self, pattern: str) -> str:
        name = plain(pattern, LONGEST_NAME)
        if name not in self._names and len(self._names) >= MOST_NAMES:
            return OTHERS
        self._names.add(name)
        return name

    def _add_latency(self, event: PatternEvent) -> None:
        """Arrival and first frame are both on the bridge's clock."""
        arrivals = [heard.arrival_ns for key, heard in event.heard.items() if key.startswith(_DRONE)]
        if arrivals and event.started_ns >= max(arrivals):
            self.latency_ms.add((event.started_ns - max(arrivals)) / 1e6)
