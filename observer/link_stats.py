"""How well everybody hears everybody, from the messages alone: messages in, numbers out; no clock, no I/O.

A link is a publisher's key and one who listens to it. The observer's own links count everything that came.
What the drones and the bridge hear is known from the `heard` entries of what they publish: which samples they
used and when those had arrived. Loss and rates are judged by `(epoch, seq)` and the publisher's stamps, never
by what an observer's own queue happened to hold.
"""

import contextlib
import math
from collections import Counter, OrderedDict, defaultdict
from collections.abc import Mapping

from attrs import frozen

from observer.histogram import Histogram, Quantiles
from shared.clock import NS_PER_S
from shared.errors import DecodeError
from shared.messages import DroneState, FormationState, Heard, Message, ProcessStatus
from shared.nodes import OBSERVER
from shared.order import AHEAD, check_newer
from shared.topics import parse_key, rank
from shared.transport import TOO_MANY

OTHER_KEYS = "other keys"
"""Stands for every key that is of no topic."""
MOST_LINKS = 16_384
"""Of a thousand drones there are a third as many; what is made up beyond is counted together, as `TOO_MANY`."""
_STALE_S = 2.0
"""A publisher that goes on further back after so long a silence has been restored, and is not late."""
_REMEMBERED = 1024
"""Recent samples of a key whose stamps are known, and recent gaps that a late sample may still fill."""


@frozen(kw_only=True)
class LinkSummary:
    """One link.

    Attributes:
        key: What is published.
        listener: Who hears it: `observer`, `drone/2`, `bridge`.
        messages: Samples that came to the observer, or that the listener says it used.
        rate_hz: Samples that the publisher sent per second, by its own count and stamps.
        jitter_ms: Standard deviation of the time between the arrivals of consecutive samples; None before two.
        missing: Samples between the first and the last that did not come; of another listener than the
            observer: that it did not use, be they lost or overtaken by a newer one.
        late: Samples that came after a newer one, or twice.
        age_ms: From the publisher's stamp to the arrival (two clocks, if on two machines).
        last_ns: Arrival of the newest sample.
    """

    key: str
    listener: str
    messages: int
    rate_hz: float
    jitter_ms: float | None
    missing: int
    late: int
    age_ms: Quantiles
    last_ns: int


class LinkStats:
    """What has been counted of one link."""

    def __init__(self) -> None:
        self._last: Heard | None = None
        self._last_stamp_ns: int | None = None
        self._missing: OrderedDict[tuple[int, int], None] = OrderedDict()
        self._messages = self._lost = self._late = 0
        self._advance = self._span_ns = 0
        self._intervals = _Deviation()
        self._age = Histogram()

    def add(self, sample: Heard, stamp_ns: int | None) -> None:
        """Counts one arrival.

        Args:
            sample: Which one, and when it arrived.
            stamp_ns: When it was sent, None if unknown.

        Raises:
            DecodeError: `ahead`: its number is out of the future, and nothing of it is counted.
        """
        last, late = self._last, self._is_late(sample)
        self._messages += 1
        if stamp_ns is not None:
            self._age.add(max(0, sample.arrival_ns - stamp_ns) / 1e6)
        if late:
            self._count_late(sample)
            return
        if last is not None and last.epoch == sample.epoch and last.seq < sample.seq:
            self._count_advance(last, sample, stamp_ns)
        self._last, self._last_stamp_ns = sample, stamp_ns

    def uses(self, sample: Heard, stamp_ns: int | None) -> None:
        """Counts a sample that a listener says it used; it says so again until it uses a newer one."""
        if self._last is None or sample[:2] > self._last[:2]:
            self.add(sample, stamp_ns)

    def summary(self, key: str, listener: str) -> LinkSummary:
        """Returns the numbers so far."""
        return LinkSummary(
            key=key,
            listener=listener,
            messages=self._messages,
            rate_hz=self._advance * NS_PER_S / self._span_ns if self._span_ns > 0 else 0.0,
            jitter_ms=self._intervals.value(),
            missing=self._lost,
            late=self._late,
            age_ms=self._age.quantiles(),
            last_ns=self._last.arrival_ns if self._last else 0,
        )

    def _is_late(self, sample: Heard) -> bool:
        if self._last is None:
            return False
        try:
            check_newer(sample, self._last, _STALE_S)
        except DecodeError as error:
            if error.reason == AHEAD:
                raise
            return True
        return False

    def _count_late(self, sample: Heard) -> None:
        """A sample that was counted as lost has come after all, or one has come twice."""
        self._late += 1
        if sample[:2] in self._missing:
            del self._missing[sample[:2]]
            self._lost -= 1

    def _count_advance(self, last: Heard, sample: Heard, stamp_ns: int | None) -> None:
        advance = sample.seq - last.seq
        self._lost += advance - 1
        for seq in range(max(last.seq + 1, sample.seq - _REMEMBERED), sample.seq):
            self._missing[sample.epoch, seq] = None
        while len(self._missing) > _REMEMBERED:
            self._missing.popitem(last=False)
        if stamp_ns is not None and self._last_stamp_ns is not None:
            self._advance += advance
            self._span_ns += stamp_ns - self._last_stamp_ns
        if advance == 1:
            self._intervals.add((sample.arrival_ns - last.arrival_ns) / 1e6)


class SwarmLinks:
    """Every link of a swarm.

    Attributes:
        rejected: What the observer found to be no valid message, by key and reason.
        processes: The newest status of every process, as `role/id`: what *they* rejected is in there.
    """

    def __init__(self) -> None:
        self.rejected: defaultdict[str, Counter[str]] = defaultdict(Counter)
        self.processes: dict[str, ProcessStatus] = {}
        self._links: dict[tuple[str, str], LinkStats] = {}
        self._stamps: defaultdict[str, dict[tuple[int, int], int]] = defaultdict(dict)

    def add(self, key: str, message: Message, arrival_ns: int) -> None:
        """Counts one valid message; what it says it heard must have been added before, to have an age."""
        sample = Heard(message.epoch, message.seq, arrival_ns)
        link = self._link(key, OBSERVER)
        if link is None:
            self.reject(key, TOO_MANY)
            return
        try:
            link.add(sample, message.stamp_ns)
        except DecodeError as error:
            self.reject(key, error.reason)
            return
        stamps = self._stamps[key]
        stamps[message.epoch, message.seq] = message.stamp_ns
        if len(stamps) > _REMEMBERED:
            del stamps[next(iter(stamps))]
        if isinstance(message, DroneState):
            self._add_heard(f"drone/{message.id}", message.heard)
        elif isinstance(message, FormationState):
            self._add_heard("bridge", message.heard)
        elif isinstance(message, ProcessStatus):
            self.processes[f"{message.role}/{message.id}"] = message

    def reject(self, key: str, reason: str) -> None:
        """Counts one payload that is no valid message; its link has a row, be it without messages.

        Those on keys of no topic share one: anybody may make up any number of them.
        """
        shown = key if _is_ours(key) and self._link(key, OBSERVER) else OTHER_KEYS
        self.rejected[shown][reason] += 1
        self._link(shown, OBSERVER)

    def rows(self) -> list[LinkSummary]:
        """Returns the observer's links in the order of the table of topics, then everybody else's."""
        everything = [link.summary(*ends) for ends, link in self._links.items()]
        return sorted(everything, key=lambda row: (row.listener != OBSERVER, rank(row.listener), rank(row.key)))

    def _add_heard(self, listener: str, heard: Mapping[str, Heard]) -> None:
        for key, sample in heard.items():
            link = self._link(key, listener) if _is_ours(key) else None
            if link is None:
                continue
            stamps = self._stamps.get(key, {})
            # Numbers that its listener makes up are no reason to doubt the message.
            with contextlib.suppress(DecodeError):
                link.uses(sample, stamps.get((sample.epoch, sample.seq)))

    def _link(self, key: str, listener: str) -> LinkStats | None:
        """Returns what has been counted of a link, None if there are too many."""
        link = self._links.get((key, listener))
        if link is None and (len(self._links) < MOST_LINKS or key == OTHER_KEYS):
            link = self._links[key, listener] = LinkStats()
        return link


def _is_ours(key: str) -> bool:
    try:
        parse_key(key)
    except DecodeError:
        return False
    return True


class _Deviation:
    """Running standard deviation (Welford)."""

    def __init__(self) -> None:
        self._count, self._mean, self._squares = 0, 0.0, 0.0

    def add(self, value: float) -> None:
        self._count += 1
        delta = value - self._mean
        self._mean += delta / self._count
        self._squares += delta * (value - self._mean)

    def value(self) -> float | None:
        return math.sqrt(self._squares / self._count) if self._count > 1 else None
