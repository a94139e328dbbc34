"""A hand that plays by itself until somebody takes it with a pointer; from then on it is the pointer's.

When the other source ends while pages are open, the swarm holds and waits for one of them instead of landing.
"""

from human_relay.sources import open_source
from human_relay.sources.base import HandPose, HandSource
from human_relay.sources.pointer import PointerHand
from shared.errors import ConfigError
from shared.messages import Wish
from shared.uri import parse_uri


class Takeover:
    """A `HandSource` made of two.

    Args:
        first: Plays until the pointer takes over or it ends; closed with this one.
        pointer: May take over; closed with this one.
    """

    def __init__(self, first: HandSource, pointer: PointerHand) -> None:
        self._first = first
        self._pointer = pointer
        self._taken = False
        self._ended = False

    def poll(self, now_ns: int) -> HandPose | None:
        """Returns the sample of whichever source has the hand; a STOP of the pointer counts at any time."""
        pointed = self._pointer.poll(now_ns)
        if self._taken:
            return pointed
        if pointed is not None and not self._ended:
            self._taken = True
            return pointed
        if pointed is not None and pointed.mode is Wish.STOP:
            return pointed
        played = self._first.poll(now_ns)
        if played is not None:
            self._pointer.rest_at(played)
        if self._first.finished and not self._ended:
            self._taken = self._pointer.is_watched(now_ns)
            self._ended = not self._taken
        return None if self._taken else played

    def next_ns(self, now_ns: int) -> int:
        """Returns when either has something."""
        pointer_ns = self._pointer.next_ns(now_ns)
        return pointer_ns if self._taken else min(pointer_ns, self._first.next_ns(now_ns))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is to be known about the source that plays."""
        return self._first.remarks

    @property
    def finished(self) -> bool:
        """Whether the first source has ended and nobody has taken over."""
        return self._ended

    def close(self) -> None:
        """Closes both."""
        self._first.close()
        self._pointer.close()


def open_takeover(uri: str, pointer: str, start_ns: int) -> HandSource:
    """Opens a hand source that plays until a pointer takes over.

    Args:
        uri: Of the source that plays first.
        pointer: URI of the pointer, for example `pointer://`.
        start_ns: When the sources' own time starts, on the clock of the process.

    Raises:
        ConfigError: As for `open_source`, or the pointer is none.
        DeviceError: As for `open_source`.
    """
    parsed = parse_uri(pointer, example="pointer://")
    if parsed.scheme != "pointer":
        raise ConfigError(f"{pointer}: only a pointer can take over, for example pointer://")
    return Takeover(open_source(uri, start_ns), PointerHand(parsed, start_ns))
