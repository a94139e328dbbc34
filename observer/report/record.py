"""A flight in memory, whatever it was recorded with: everything on one time axis. Pure."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from attrs import field, frozen

from shared.arrays import stretches
from shared.clock import NS_PER_S
from shared.formation import Formation
from shared.recordings.check import gap_ns
from shared.recordings.track import Vec
from shared.scenario import Hand, Obstacle

ROW_HZ = 60.0
"""Rows per second of a record."""
STALE_S = 0.5
"""Nobody holds a set-point for longer: then its recording has a gap."""


class Played(NamedTuple):
    """A pattern that the operator felt: when it began (s, on `recorded_t`), its name and its length, s."""

    t: float
    name: str
    length: float


@frozen(kw_only=True, eq=False)
class FlightRecord:
    """A flight of N drones in T rows at 60 Hz, from the first to the last moment at which all of them flew.

    Where somebody was not recorded for longer than a few frames, nothing is a number: gaps stay gaps.

    Attributes:
        name: What to call it.
        source: What it was recorded with.
        formation: Who flew, and who referred to whom.
        t: (T,) time of the rows since the first, s.
        recorded_t: (T,) when the rows arrived at the recorder, on the same zero, s.
        hand: (T, 3) the hand, m.
        hand_velocity: (T, 3) m/s.
        mapped: (T, 3) the mapped hand, m.
        position: (T, N, 3) bodies, m.
        goal: (T, N, 3) before avoidance, m.
        setpoint: (T, N, 3) after it, m.
        displacement: Link -> (T, 3) impedance displacement in the formation frame, m; empty without impedance.
        default_area: Area of the undisturbed formation, m^2.
        obstacles: Columns.
        zones: Of each, the radius of the zone around its centre in which avoidance acts, m.
        walkers: Number -> (T, 3) way of what moved among the drones, m.
        patterns: What the operator felt.
        remarks: What was left out, and why, in words.
        mapping_known: Whether it is known how the hand was mapped; if not, `mapped` is the hand itself.
    """

    name: str
    source: str
    formation: Formation
    t: Vec
    recorded_t: Vec
    hand: Vec
    hand_velocity: Vec
    mapped: Vec
    position: Vec
    goal: Vec
    setpoint: Vec
    displacement: Mapping[str, Vec]
    default_area: float
    obstacles: tuple[Obstacle, ...]
    zones: tuple[float, ...]
    walkers: Mapping[int, Vec] = field(factory=dict)
    patterns: tuple[Played, ...] = ()
    remarks: tuple[str, ...] = ()
    mapping_known: bool = True

    @property
    def ids(self) -> tuple[int, ...]:
        """Returns the numbers of the drones, in the order of the columns."""
        return self.formation.ids

    @property
    def hand_label(self) -> str:
        """Returns what to call `mapped` in a figure."""
        return "mapped hand" if self.mapping_known else "hand"


def mapped_hand(position: Vec, hand: Hand) -> Vec:
    """Maps the hand as `[hand]` says, without the limits on its way: where the formation is wanted.

    Args:
        position: (T, 3) the hand, m.
        hand: The mapping.

    Returns:
        (T, 3) m.
    """
    point = position.copy()
    if hand.mapping == "relative":
        point = np.array(hand.offset) + hand.gain * point
    if hand.height is not None:
        point[:, 2] = hand.height
    if hand.clip is not None:
        point[:, :2] = np.clip(point[:, :2], hand.clip.min, hand.clip.max)
    return point


def resample(t: Vec, at: Vec, values: Vec) -> Vec:
    """Interpolates linearly; where nothing was recorded for longer than a gap, there is nothing.

    Args:
        t: (T,) wanted times.
        at: (n,) times of the values, increasing, s.
        values: (n, k).

    Returns:
        (T, k), not a number in gaps and where the values have not begun or have ended.
    """
    found = np.column_stack([np.interp(t, at, column) for column in values.T])
    longest = gap_ns(np.rint(at * NS_PER_S).astype(np.int64)) / NS_PER_S
    after = np.searchsorted(at, t)
    begins, ends = np.append(-np.inf, at)[after], np.append(at, np.inf)[after]
    near = (t - begins <= longest) | (ends - t <= longest)
    bridged = (ends - begins <= longest) | (ends == t) | (near & ~np.isfinite(ends - begins))
    return np.where(bridged[:, None], found, np.nan)


def hold(t: Vec, at: Vec, values: Vec) -> Vec:
    """Returns the last of `values` (n, k) at each wanted time, (T, k); not a number if that is old.

    The first one counts a while before it was said: a recorder starts in the middle of things.
    """
    row = np.maximum(np.searchsorted(at, t, side="right") - 1, 0)
    return np.where((np.abs(t - at[row]) <= STALE_S)[:, None], values[row], np.nan)


def runs(values: Vec) -> list[slice]:
    """Returns the stretches of rows (T, k) without a gap, in order."""
    return stretches(np.array(~np.isnan(values).any(axis=1)))
