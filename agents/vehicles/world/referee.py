"""The referee: true distances, collisions and fence exits, independent of what agents believe. Pure.

Only bodies in the air count: a pair counts if at least one of the two is airborne. Contacts and exits are
counted once per episode.
"""

import functools
import math
from typing import NamedTuple

import numpy as np
from attrs import evolve, frozen

from agents.vehicles.bodies.state import Mask, Vec


@frozen(kw_only=True, eq=False)
class Rules:
    """What counts.

    Attributes:
        ids: Numbers of the drones, one per row.
        columns: (M, 2) axes of the vertical columns, m.
        column_radius: Radius of a column, m.
        body_radius: Half the contact distance of two bodies, m: a Crazyflie's arm (0.046) and its propeller.
        fence: Lower and upper corner (3,) of the fence, m.
    """

    ids: tuple[int, ...]
    columns: Vec
    column_radius: float
    body_radius: float = 0.06
    fence: tuple[Vec, Vec]


class Closest(NamedTuple):
    """The smallest distance so far: how near, between whom, when."""

    distance: float = math.inf
    drones: tuple[int, ...] = ()
    t: float = 0.0


NEVER = Closest()


@frozen(kw_only=True, eq=False)
class RefereeState:
    """What the referee has seen.

    Attributes:
        pair: Nearest two drones (3-D).
        hand: Nearest drone to the hand (3-D).
        drone_contacts: Contacts between drones.
        column_contacts: Contacts with columns.
        fence_exits: Exits from the fence.
        touching: (N, N) pairs in contact at the last update, upper triangle.
        grazing: (N, M) drones in contact with columns at the last update.
        outside: (N,) drones outside the fence at the last update.
    """

    pair: Closest = NEVER
    hand: Closest = NEVER
    drone_contacts: int = 0
    column_contacts: int = 0
    fence_exits: int = 0
    touching: Mask
    grazing: Mask
    outside: Mask


def start_referee(rules: Rules) -> RefereeState:
    """Returns the state before the first update."""
    n = len(rules.ids)
    return RefereeState(
        touching=np.zeros((n, n), dtype=bool),
        grazing=np.zeros((n, len(rules.columns)), dtype=bool),
        outside=np.zeros(n, dtype=bool),
    )


def update(
    rules: Rules, state: RefereeState, positions: Vec, airborne: Mask, *, hand: Vec | None, t: float
) -> RefereeState:
    """Looks at one instant.

    Args:
        rules: What counts.
        state: What was seen before.
        positions: (N, 3) world frame, m.
        airborne: (N,) which bodies are clear of the ground.
        hand: (3,) the hand in the world frame, m; None if unknown.
        t: Time, s.
    """
    if not airborne.any():
        calm = start_referee(rules)
        return evolve(state, touching=calm.touching, grazing=calm.grazing, outside=calm.outside)
    gaps = _pair_gaps(positions, airborne)
    touching = gaps < 2.0 * rules.body_radius
    grazing = airborne[:, None] & (
        _column_gaps(positions, rules.columns) < rules.column_radius + rules.body_radius
    )
    low, high = rules.fence
    outside = airborne & ((positions < low) | (positions > high)).any(axis=1)
    return RefereeState(
        pair=_nearest(state.pair, gaps, rules.ids, t),
        hand=_nearest(state.hand, _hand_gaps(positions, airborne, hand), rules.ids, t),
        drone_contacts=state.drone_contacts + _begun(state.touching, touching),
        column_contacts=state.column_contacts + _begun(state.grazing, grazing),
        fence_exits=state.fence_exits + _begun(state.outside, outside),
        touching=touching,
        grazing=grazing,
        outside=outside,
    )


def report(state: RefereeState) -> dict[str, float]:
    """Returns the numbers by name; a distance that was never defined is left out.

    `collisions` is the sum of the contacts with drones and with columns.
    """
    numbers: dict[str, float] = {
        "collisions": state.drone_contacts + state.column_contacts,
        "column_contacts": state.column_contacts,
        "fence_exits": state.fence_exits,
    }
    if state.pair.drones:
        numbers["min_distance_m"] = state.pair.distance
        numbers["min_distance_t_s"] = state.pair.t
        numbers["min_distance_from"], numbers["min_distance_to"] = state.pair.drones
    if state.hand.drones:
        numbers["min_hand_distance_m"] = state.hand.distance
        numbers["min_hand_distance_t_s"] = state.hand.t
        (numbers["min_hand_distance_to"],) = state.hand.drones
    return numbers


def _pair_gaps(positions: Vec, airborne: Mask) -> Vec:
    """(N, N) distances of the pairs that count, infinite elsewhere; upper triangle."""
    offsets = positions[:, None] - positions[None]
    gaps: Vec = np.sqrt(np.einsum("ijk,ijk->ij", offsets, offsets))
    gaps[_counted_already(len(positions)) | ~(airborne[:, None] | airborne)] = np.inf
    return gaps


@functools.cache
def _counted_already(n: int) -> Mask:
    """(N, N) lower triangle and diagonal: pairs that the upper one has."""
    return np.tri(n, dtype=bool)


def _column_gaps(positions: Vec, columns: Vec) -> Vec:
    """(N, M) horizontal distances from the columns' axes."""
    offsets = positions[:, None, :2] - columns[None]
    gaps: Vec = np.sqrt(np.einsum("ijk,ijk->ij", offsets, offsets))
    return gaps


def _hand_gaps(positions: Vec, airborne: Mask, hand: Vec | None) -> Vec:
    """(N,) distances from the hand, infinite where they do not count."""
    if hand is None:
        return np.full(len(positions), np.inf)
    offsets = positions - hand
    return np.where(airborne, np.sqrt(np.einsum("ij,ij->i", offsets, offsets)), np.inf)


def _nearest(before: Closest, gaps: Vec, ids: tuple[int, ...], t: float) -> Closest:
    distance = float(gaps.min())
    if distance < before.distance:
        where = np.unravel_index(np.argmin(gaps), gaps.shape)
        return Closest(distance, tuple(ids[row] for row in where), t)
    return before


def _begun(before: Mask, now: Mask) -> int:
    return int(np.count_nonzero(now & ~before))
