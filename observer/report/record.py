"""A flight in memory, whatever it was recorded with: everything on one time axis. Pure."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from attrs import frozen

from shared.formation import Formation
from shared.recordings.track import Vec
from shared.scenario import Hand, Obstacle

ROW_HZ = 60.0
"""Rows per second of a record."""


class Played(NamedTuple):
    """A pattern that the operator felt: when it began (s, on `recorded_t`), its name and its length, s."""

    t: float
    name: str
    length: float


@frozen(kw_only=True, eq=False)
class FlightRecord:
    """A flight of N drones in T rows at 60 Hz, from the first to the last moment at which all of them flew.

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
        safety_radius: Of the zone around a column's centre in which avoidance acts, m.
        patterns: What the operator felt.
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
    safety_radius: float
    patterns: tuple[Played, ...] = ()
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
    """Interpolates linearly; gaps are bridged straight, ends are held.

    Args:
        t: (T,) wanted times.
        at: (n,) times of the values, increasing.
        values: (n, k).

    Returns:
        (T, k).
    """
    return np.column_stack([np.interp(t, at, column) for column in values.T])


def hold(t: Vec, at: Vec, values: Vec) -> Vec:
    """Returns the last of `values` (n, k) at or before each wanted time (the first one before it), (T, k)."""
    held: Vec = values[np.maximum(np.searchsorted(at, t, side="right") - 1, 0)]
    return held
