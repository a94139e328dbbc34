"""Many runs side by side, each flown by one central computer, watched independently of it."""

from collections.abc import Iterator, Sequence
from collections.abc import Set as AbstractSet
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from agents.settings import hand_settings
from deploy.lockstep.central import Flock
from deploy.lockstep.hand_track import map_samples
from deploy.lockstep.record import Record
from deploy.lockstep.start import rest_places
from shared.fence import fence_box
from shared.formation import build_formation
from shared.messages import HandSample
from shared.scenario import Scenario

Vec = npt.NDArray[np.float64]


class Tick(NamedTuple):
    """One tick of B runs: hand and mapped hand (B, 1, 3), bodies and goals (B, N, 3), m."""

    hand: Vec
    mapped: Vec
    position: Vec
    goal: Vec


class Distances(NamedTuple):
    """Smallest distances of each of B runs, 3-D, m, and how far a body was out of the fence at most, m."""

    drones: Vec
    hand: Vec
    outside: Vec


def fly_all(
    scenario: Scenario,
    hands: Sequence[Sequence[HandSample]],
    held: AbstractSet[tuple[int, int]] = frozenset(),
) -> Iterator[Tick]:
    """Flies all hands at once, each from the rest formation; a shorter hand stays at its end."""
    formation = build_formation(scenario)
    settings = hand_settings(scenario, formation)
    tracks = [map_samples(samples, settings) for samples in hands]
    flocks = [
        Flock(scenario, formation, rest_places(formation, track[0][1]), {row for run, row in held if run == k})
        for k, track in enumerate(tracks)
    ]
    for tick in range(max(map(len, tracks))):
        now = [track[min(tick, len(track) - 1)] for track in tracks]
        for flock, (sample, mapped) in zip(flocks, now, strict=True):
            flock.advance(sample, mapped)
        yield Tick(
            np.array([[sample.position] for sample, _ in now]),
            np.array([[mapped.point] for _, mapped in now]),
            np.array([[member.position for member in flock.members] for flock in flocks]),
            np.array([[member.goal for member in flock.members] for flock in flocks]),
        )


def distances(scenario: Scenario, ticks: Iterator[Tick]) -> Distances:
    """Watches runs to their end."""
    low, high = map(np.array, fence_box(scenario, build_formation(scenario)))
    worst: Distances | None = None
    for tick in ticks:
        now = _distances_now(tick, low, high)
        worst = (
            now
            if worst is None
            else Distances(
                np.minimum(worst.drones, now.drones),
                np.minimum(worst.hand, now.hand),
                np.maximum(worst.outside, now.outside),
            )
        )
    assert worst is not None
    return worst


def record_distances(scenario: Scenario, record: Record) -> Distances:
    """The same for a record of one run."""
    hand, mapped = record.hand.position[:, None, None], record.hand.point[:, None, None]
    rows = zip(hand, mapped, record.position[:, None], record.goal[:, None], strict=True)
    return distances(scenario, (Tick(*row) for row in rows))


def _distances_now(tick: Tick, low: Vec, high: Vec) -> Distances:
    position = tick.position
    drones = position.shape[1]
    gaps = np.linalg.norm(position[:, :, None] - position[:, None], axis=3)
    gaps[:, np.arange(drones), np.arange(drones)] = np.inf
    outside = np.maximum(low - position, position - high).max(axis=(1, 2))
    return Distances(gaps.min(axis=(1, 2)), np.linalg.norm(position - tick.hand, axis=2).min(axis=1), outside)
