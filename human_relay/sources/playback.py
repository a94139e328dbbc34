"""Plays a sequence of hand poses at their own times; scripts and recordings are such sequences."""

from collections.abc import Iterator

from attrs import evolve

from human_relay.sources.base import HandPose
from shared.clock import NS_PER_S
from shared.messages import Wish

RATE_HZ = 60
"""Poses per second of whatever is played; the relay sends no more."""
PERIOD_NS = NS_PER_S // RATE_HZ

MAX_LATE_NS = NS_PER_S // 10
"""A loop that was held up longer than this jumps to the newest sample; a burst of old ones helps nobody."""

GAP_NS = NS_PER_S // 10
"""Where there is no pose for longer, there is no hand."""


class Playback:
    """A `HandSource` that delivers every pose once, in order, none before its time.

    Args:
        poses: In the order of their `t_ns`; they are drawn one ahead.
        remarks: What is to be known about them.

    Attributes:
        remarks: See `HandSource.remarks`.
    """

    def __init__(self, poses: Iterator[HandPose], remarks: tuple[str, ...] = ()) -> None:
        self.remarks = remarks
        self._poses = poses
        self._current: HandPose | None = None
        self._upcoming = next(poses, None)

    def poll(self, now_ns: int) -> HandPose | None:
        """Returns the next due pose, or the last one again, in the end with LAND; None in a gap."""
        if self._is_due(now_ns):
            is_late = self._is_due(now_ns - MAX_LATE_NS)
            self._advance()
            while is_late and self._is_due(now_ns):
                self._advance()
        if self._current and self.finished:
            return evolve(self._current, mode=Wish.LAND)
        if self._current and now_ns - self._current.t_ns > GAP_NS:
            return None
        return self._current

    def next_ns(self, now_ns: int) -> int:
        """Returns the time of the next pose; after the last, one period from now."""
        return self._upcoming.t_ns if self._upcoming else now_ns + PERIOD_NS

    @property
    def finished(self) -> bool:
        """Whether the last pose has been delivered."""
        return self._upcoming is None

    def close(self) -> None:
        """Ends the playback."""
        self._upcoming = None

    def _is_due(self, now_ns: int) -> bool:
        return self._upcoming is not None and self._upcoming.t_ns <= now_ns

    def _advance(self) -> None:
        self._current = self._upcoming
        self._upcoming = next(self._poses, None)
