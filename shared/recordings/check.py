"""What comes in is checked once, for all formats: what cannot be is left out, and one line says so. Pure.

A pose is left out if it is not a number, is out of the room, has no orientation where the others have one, or
came at no time: without a stamp, out of order, or with a stamp that fits neither its neighbours nor its
arrival. Where stamps are of no use, arrival times stand in for them. What is no recording at all is refused.
"""

from bisect import bisect_left
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from attrs import frozen

from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.recordings.track import NO_STAMP, Found, Rows, Stamps, Track

ROOM = 20.0
"""Nobody tracks a hand or a small drone farther from the origin, m; in millimetres everybody is."""
GAP_S = 0.1
"""Without a pose for longer there was none; shorter, some frames were lost on the way."""
GAP_PERIODS = 2.5
"""Slow recordings have a gap where so many of their usual periods passed without a pose."""

TRUSTED = 0.9
"""Stamps of which fewer are usable are not used at all, if there are arrival times."""
STRAY_NS = 5 * NS_PER_S
"""Stamps stray from the arrivals by no more than this, beyond what the clocks differ by."""
LONGEST_S = 12 * 3600
"""A recording that takes longer is none of a flight."""
SLOWEST_NS = 2 * NS_PER_S
"""Poses that are usually farther apart than this are none of a motion; milliseconds read as seconds are."""
LONELY_NS = 60 * NS_PER_S
"""A stamp so far from all others is wrong."""
_UNIT = (0.9, 1.1)
"""Norm of a quaternion that is an orientation; single precision and rounding are far within."""

Mask = npt.NDArray[np.bool_]

NO_NUMBER, UNTURNED, NO_TIME, OUT_OF_TIME = (
    "not a number",
    "without an orientation",
    "without a stamp",
    "out of time",
)


@frozen(kw_only=True)
class Report:
    """What a recording is like, and what is not in it.

    Attributes:
        found: Poses that came in.
        left_out: Reason -> how many, and where the first of them stands.
        by_arrival: Whether the times are those of arrival.
        unturned: Whether the format has orientations, but there are none in it.
        rate_hz: Usual rate.
        gaps: How many times there was no pose for longer than `gap_ns`.
        longest_gap_s: s; 0 without a gap.
        low: Least coordinates (x, y, z), m.
        high: Largest ones, m.
        unit: What is counted: `pose`, or `line` of the file.
        unread: What the reader could not read, in words.
    """

    found: int
    left_out: Mapping[str, tuple[int, int]]
    by_arrival: bool
    unturned: bool
    rate_hz: float
    gaps: int
    longest_gap_s: float
    low: tuple[float, ...]
    high: tuple[float, ...]
    unit: str = "pose"
    unread: tuple[str, ...] = ()

    @property
    def remarks(self) -> tuple[str, ...]:
        """Returns in words what was left out and why, and what else is not there; empty if all is well."""
        told = list(self.unread)
        if self.left_out:
            reasons = (
                f"{count} {reason} (the first: {self.unit} {first})"
                for reason, (count, first) in self.left_out.items()
            )
            number = sum(count for count, _ in self.left_out.values())
            told.append(f"{number} of {self.found} poses left out: {', '.join(reasons)}")
        if self.by_arrival:
            told.append("its stamps are of no use (0, or out of order): arrival times are used")
        if self.unturned:
            told.append("it has no orientations: the heading stays what it is at the start")
        if self.gaps:
            gaps = "a gap" if self.gaps == 1 else f"{self.gaps} gaps, the longest"
            told.append(f"{gaps} of {self.longest_gap_s:.1f} s")
        return tuple(told)


class Checked(NamedTuple):
    """What is left.

    Attributes:
        track: Every number finite, the stamps increasing; orientations are 1 where there are none.
        rows: (k,) which of the poses that came in these are.
        arrival_ns: (k,) when they came to the recorder, ns; the stamps where nobody knows.
        report: What was left out, and why.
    """

    track: Track
    rows: Rows
    arrival_ns: Stamps
    report: Report


def check(found: Found, name: str, room: float = ROOM) -> Checked:
    """Checks a recorded body.

    Args:
        found: What a reader has found.
        name: What to call it in messages: the file, and the body in it.
        room: How far from the origin it can be, m.

    Raises:
        ConfigError: It is no recording of a body in a room, in metres, over time.
    """
    left = _LeftOut(found)
    left.out(np.array(~np.isfinite(found.position).all(axis=1)), NO_NUMBER)
    _keep_in_room(found, left, name, room)
    turns = _keep_turned(found, left)
    t_ns, by_arrival = _keep_in_time(found, left, name)
    rows = np.flatnonzero(left.good)
    if len(rows) < 2:
        why = "; ".join(filter(None, (*found.remarks, left.words()))) or "fewer than two poses"
        raise ConfigError(f"{name}: nothing to go by: {why}")
    usual = float(np.median(np.diff(t_ns[rows])))
    if usual > SLOWEST_NS:
        raise ConfigError(
            f"{name}: {usual / NS_PER_S:.1f} s from one pose to the next; are the times milliseconds?"
            " Write seconds"
        )
    if t_ns[rows[-1]] - t_ns[rows[0]] > LONGEST_S * NS_PER_S:
        raise ConfigError(f"{name}: it takes more than {LONGEST_S // 3600} hours; take a part of it")
    position = found.position[rows]
    quaternion = np.tile([0.0, 0.0, 0.0, 1.0], (len(rows), 1))
    if turns and found.quaternion is not None:
        quaternion = found.quaternion[rows]
    steps = np.diff(t_ns[rows])
    gaps = steps[steps > gap_ns(t_ns[rows])]
    report = Report(
        found=len(found.t_ns),
        left_out=left.reasons,
        by_arrival=by_arrival,
        unturned=found.quaternion is not None and not turns,
        rate_hz=NS_PER_S / float(np.median(steps)),
        gaps=len(gaps),
        longest_gap_s=int(gaps.max(initial=0)) / NS_PER_S,
        low=tuple(position.min(axis=0).tolist()),
        high=tuple(position.max(axis=0).tolist()),
        unit=left.unit,
        unread=found.remarks,
    )
    arrival_ns = t_ns if found.arrival_ns is None else found.arrival_ns
    return Checked(Track(t_ns[rows], position, quaternion), rows, arrival_ns[rows], report)


def gap_ns(t_ns: Stamps) -> int:
    """Returns the time between two poses of a recording beyond which there was none, ns."""
    usual = float(np.median(np.diff(t_ns))) if len(t_ns) > 1 else 0.0
    return max(round(GAP_S * NS_PER_S), round(GAP_PERIODS * usual))


class _LeftOut:
    """Which poses are good so far, and why the others are not."""

    def __init__(self, found: Found) -> None:
        self.good: Mask = np.ones(len(found.t_ns), dtype=np.bool_)
        self.reasons: dict[str, tuple[int, int]] = {}
        self.unit = "pose" if found.lines is None else "line"
        self._lines = found.lines

    def out(self, bad: Mask, reason: str) -> None:
        """Leaves poses out that have not been left out already."""
        fresh = np.flatnonzero(bad & self.good)
        if len(fresh):
            first = int(fresh[0])
            place = first + 1 if self._lines is None else int(self._lines[first])
            self.reasons[reason] = (len(fresh), place)
            self.good[fresh] = False

    def words(self) -> str:
        return ", ".join(
            f"{count} {'pose is' if count == 1 else 'poses are'} {reason} (the first: {self.unit} {place})"
            for reason, (count, place) in self.reasons.items()
        )


def _keep_in_room(found: Found, left: _LeftOut, name: str, room: float) -> None:
    reach = np.abs(np.where(left.good[:, None], found.position, 0.0)).max(axis=1)
    far = reach > room
    if 2 * np.count_nonzero(far) > np.count_nonzero(left.good):
        raise ConfigError(
            f"{name}: places {reach.max():.0f} m away from the origin; are they millimetres?"
            f" Write metres, no farther than {room:g} m from the origin"
        )
    left.out(far, f"more than {room:g} m away")


def _keep_turned(found: Found, left: _LeftOut) -> bool:
    """Leaves out what has no orientation, and says whether there are orientations at all."""
    if found.quaternion is None:
        return False
    with np.errstate(over="ignore", invalid="ignore"):
        norm = np.linalg.norm(found.quaternion, axis=1)
    turned = (norm > _UNIT[0]) & (norm < _UNIT[1])
    if 2 * np.count_nonzero(turned & left.good) <= np.count_nonzero(left.good):
        return False
    left.out(~turned, UNTURNED)
    return True


def _keep_in_time(found: Found, left: _LeftOut, name: str) -> tuple[Stamps, bool]:
    """Leaves out what is out of time; returns the times, ns, and whether they are those of arrival."""
    rows = np.flatnonzero(left.good)
    by_stamp = np.zeros_like(left.good)
    arrival = None if found.arrival_ns is None else found.arrival_ns[rows]
    by_stamp[rows] = _usable(found.t_ns[rows], arrival)
    if found.arrival_ns is not None and np.count_nonzero(by_stamp) < TRUSTED * len(rows):
        by_arrival = np.zeros_like(left.good)
        by_arrival[rows] = _usable(found.arrival_ns[rows], None)
        if np.count_nonzero(by_arrival) > np.count_nonzero(by_stamp):
            left.out(~by_arrival, OUT_OF_TIME)
            return found.arrival_ns, True
    left.out(found.t_ns == NO_STAMP, NO_TIME)
    if 2 * np.count_nonzero(by_stamp) < np.count_nonzero(left.good):
        left.out(~by_stamp, OUT_OF_TIME)
        raise ConfigError(f"{name}: most poses come at no time: {left.words()}; sort them by time")
    left.out(~by_stamp, OUT_OF_TIME)
    return found.t_ns, False


def _usable(t_ns: Stamps, arrival_ns: Stamps | None) -> Mask:
    """Says which times can be gone by: said, near their arrival, in order, and not alone."""
    usable: Mask = t_ns != NO_STAMP
    if arrival_ns is not None and usable.any():
        ahead = t_ns.astype(np.float64) - arrival_ns
        usable &= np.abs(ahead - np.median(ahead[usable])) <= STRAY_NS
    rows = np.flatnonzero(usable)
    if len(rows):
        rows = rows[_longest_increase(t_ns[rows])]
    if len(rows) < 2:
        return _only(rows, len(t_ns))
    away = np.concatenate([[True], np.diff(t_ns[rows].astype(np.float64)) > LONELY_NS, [True]])
    return _only(rows[~(away[:-1] & away[1:])], len(t_ns))


def _only(rows: Rows, count: int) -> Mask:
    mask: Mask = np.zeros(count, dtype=np.bool_)
    mask[rows] = True
    return mask


def _longest_increase(t_ns: Stamps) -> Rows:
    """Returns the rows of a longest strictly increasing sequence: as few as possible are left out."""
    if np.all(t_ns[1:] > t_ns[:-1]):
        return np.arange(len(t_ns))
    # Patience sorting: the least end of an increase of each length, and which row stands before each.
    ends, end_rows, before = list[int](), list[int](), list[int]()
    for row, stamp in enumerate(t_ns.tolist()):
        length = bisect_left(ends, stamp)
        before.append(end_rows[length - 1] if length else -1)
        ends[length : length + 1] = [stamp]
        end_rows[length : length + 1] = [row]
    chain, row = list[int](), end_rows[-1]
    while row >= 0:
        chain.append(row)
        row = before[row]
    return np.array(chain[::-1], dtype=np.intp)
