"""What a hand source is: poses with the operator's wish, at the source's own pace."""

from typing import Protocol

from attrs import frozen

from shared.messages import Vector, Wish
from shared.uri import Uri


@frozen(kw_only=True)
class HandPose:
    """One sample of the hand.

    Attributes:
        position: World frame, m.
        yaw: Heading about z relative to the first sample, rad.
        mode: The wish that the source itself expresses.
        t_ns: When the sample was taken, on the clock of the process.
    """

    position: Vector
    yaw: float
    mode: Wish
    t_ns: int


"""What a backend is opened with."""


class HandSource(Protocol):
    """A hand, polled by one loop. `poll` never blocks and never raises for bad data."""

    def poll(self, now_ns: int) -> HandPose | None:
        """Returns the newest sample up to now; None while there is no hand (released, not yet seen).

        The same sample again (same `t_ns`) means that there is no new one.
        """
        ...

    def next_ns(self, now_ns: int) -> int:
        """Returns when to poll again: the time of the next sample where it is known."""
        ...

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the operator is to know before it flies: what was left out of a recording, and why."""
        ...

    @property
    def finished(self) -> bool:
        """Whether a recording or a bounded script has ended; stays true."""
        ...

    def close(self) -> None:
        """Releases what the source holds; further calls do nothing."""
        ...


class HandBackend(Protocol):
    """A class of sources, as the backend table loads it."""

    def __call__(self, uri: Uri, start_ns: int) -> HandSource:
        """Opens a source whose own time starts at `start_ns` (clock of the process)."""
        ...

    def hints(self, uri: Uri) -> dict[str, object]:
        """Returns what the source knows about the mapping: dotted scenario keys and their values."""
        ...
