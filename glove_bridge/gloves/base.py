"""What a glove is to the bridge: it takes whole patterns and reports how they went."""

import enum
from collections import Counter
from typing import NamedTuple, Protocol

from glove_bridge.patterns.pattern import Pattern
from shared.uri import Uri


class Outcome(enum.StrEnum):
    """What became of a pattern."""

    STARTED = "started"
    FINISHED = "finished"
    SUPPRESSED = "suppressed"
    """It was wished for while the glove was busy, and no longer when it was free: no glove reports that."""
    FAILED = "failed"
    """It did not start, or was cut short."""


LONGEST_WAIT_S = 3.0
CUT_SHORT = "cut short by something newer"
"""Why a pattern fails that was stopped, or for which another one was asked."""
CLOSED = "closed"
"""The fault of a glove that was closed."""


class Report(NamedTuple):
    """One step in the life of the pattern that was given last; at most `STARTED`, then one of the others.

    Attributes:
        outcome: `STARTED`, `FINISHED` or `FAILED`.
        at_ns: When, on the clock of the process.
        why: Of a failure, for people.
    """

    outcome: Outcome
    at_ns: int
    why: str = ""


class GloveBackend(Protocol):
    """A class of gloves, as the backend table loads it."""

    def __call__(self, uri: Uri) -> "Glove":
        """Opens a glove."""
        ...

    def check(self, uri: Uri) -> None:
        """Refuses a URI that it cannot use, and touches no device; raises `ConfigError`."""
        ...


class Glove(Protocol):
    """Five vibrating fingertips. No call blocks, and none raises because the device is out of reach.

    Whatever the device does, a pattern ends: `LONGEST_WAIT_S` after its length at the latest.
    """

    @property
    def connected(self) -> bool:
        """Whether patterns can be felt."""
        ...

    @property
    def fault(self) -> str:
        """Why they cannot, for people; empty while they can."""
        ...

    @property
    def rejected(self) -> Counter[str]:
        """What the device has said that was dropped, by reason."""
        ...

    def play(self, pattern: Pattern, now_ns: int) -> None:
        """Starts a whole pattern; one that still plays fails."""
        ...

    def poll(self, now_ns: int) -> list[Report]:
        """Moves on to `now_ns`; returns what has happened since the last call, oldest first."""
        ...

    def next_ns(self) -> int | None:
        """Returns when to poll again; None while nothing plays."""
        ...

    def stop(self, now_ns: int) -> None:
        """Silences every finger at once; what played fails."""
        ...

    def close(self) -> None:
        """Silences every finger and releases the device; further calls do nothing."""
        ...
