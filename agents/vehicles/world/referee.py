"""The referee: true distances, collisions and fence exits, independent of what agents believe. Pure.

Only bodies in the air count: a pair counts if at least one of the two is airborne. Contacts and exits are
counted once per episode.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, TypeVar

from attrs import evolve, frozen

from shared.cells import near_pairs
from shared.cylinders import Cylinder
from shared.messages import Vector

K = TypeVar("K", bound=tuple[int, ...])

_FIRST_REACH = 1.0
"""How far the first pair is looked for at first, m."""


@frozen(kw_only=True)
class Rules:
    """What counts.

    Attributes:
        ids: Numbers of the drones.
        columns: The columns.
        body_radius: Half the contact distance of two bodies, m: a Crazyflie's arm (0.046) and its propeller.
        fence: Lower and upper corner of the fence, m.
    """

    ids: tuple[int, ...]
    columns: tuple[Cylinder, ...]
    body_radius: float = 0.06
    fence: tuple[Vector, Vector]


class Closest(NamedTuple):
    """The smallest distance so far: how near, between whom, when."""

    distance: float = math.inf
    drones: tuple[int, ...] = ()
    t: float = 0.0


NEVER = Closest()
NOBODY: frozenset[tuple[int, int]] = frozenset()


@frozen(kw_only=True)
class RefereeState:
    """What the referee has seen.

    Attributes:
        pair: Nearest two drones (3-D).
        hand: Nearest drone to the hand (3-D).
        obstacle: Nearest drone to the surface of a moving obstacle.
        drone_contacts: Contacts between drones.
        column_contacts: Contacts with columns.
        obstacle_contacts: Contacts with moving obstacles.
        fence_exits: Exits from the fence.
        touching: Pairs of drones in contact at the last update.
        grazing: Drones in contact with columns at the last update, and with which.
        bumping: The same with moving obstacles.
        outside: Drones outside the fence at the last update.
    """

    pair: Closest = NEVER
    hand: Closest = NEVER
    obstacle: Closest = NEVER
    drone_contacts: int = 0
    column_contacts: int = 0
    obstacle_contacts: int = 0
    fence_exits: int = 0
    touching: frozenset[tuple[int, int]] = NOBODY
    grazing: frozenset[tuple[int, int]] = NOBODY
    bumping: frozenset[tuple[int, int]] = NOBODY
    outside: frozenset[int] = frozenset()


def update(
    rules: Rules,
    state: RefereeState,
    positions: Sequence[Vector],
    airborne: Sequence[bool],
    *,
    hand: Vector | None,
    t: float,
    obstacles: Sequence[Cylinder] = (),
) -> RefereeState:
    """Looks at one instant.

    Args:
        rules: What counts.
        state: What was seen before.
        positions: Of the drones in the order of the rules, world frame, m.
        airborne: Which bodies are clear of the ground.
        hand: The hand in the world frame, m; None if unknown.
        t: Time, s.
        obstacles: What moves among the drones, as it is now.
    """
    if not any(airborne):
        return evolve(state, touching=NOBODY, grazing=NOBODY, bumping=NOBODY, outside=frozenset())
    contact = 2.0 * rules.body_radius
    gaps = _gaps(rules, positions, airborne, max(contact, state.pair.distance))
    touching = frozenset(pair for pair, gap in gaps.items() if gap < contact)
    flying = [(rules.ids[k], positions[k]) for k in range(len(rules.ids)) if airborne[k]]
    grazing = frozenset(key for key, gap in _surface_gaps(flying, rules.columns) if gap < rules.body_radius)
    to_obstacles = dict(_surface_gaps(flying, obstacles))
    bumping = frozenset(key for key, gap in to_obstacles.items() if gap < rules.body_radius)
    outside = frozenset(drone for drone, position in flying if _is_outside(position, rules.fence))
    to_hand = {} if hand is None else {(drone,): math.dist(position, hand) for drone, position in flying}
    return RefereeState(
        pair=_nearest(state.pair, gaps, t),
        hand=_nearest(state.hand, to_hand, t),
        obstacle=_nearest(state.obstacle, to_obstacles, t),
        drone_contacts=state.drone_contacts + len(touching - state.touching),
        column_contacts=state.column_contacts + len(grazing - state.grazing),
        obstacle_contacts=state.obstacle_contacts + len(bumping - state.bumping),
        fence_exits=state.fence_exits + len(outside - state.outside),
        touching=touching,
        grazing=grazing,
        bumping=bumping,
        outside=outside,
    )


def report(state: RefereeState) -> dict[str, float]:
    """Returns the numbers by name; a distance that was never defined is left out.

    `collisions` is the sum of the contacts with drones, columns and moving obstacles.
    """
    numbers: dict[str, float] = {
        "collisions": state.drone_contacts + state.column_contacts + state.obstacle_contacts,
        "column_contacts": state.column_contacts,
        "obstacle_contacts": state.obstacle_contacts,
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
    if state.obstacle.drones:
        numbers["min_obstacle_distance_m"] = state.obstacle.distance
        numbers["min_obstacle_distance_t_s"] = state.obstacle.t
        numbers["min_obstacle_distance_to"], _ = state.obstacle.drones
    return numbers


def _gaps(
    rules: Rules, positions: Sequence[Vector], airborne: Sequence[bool], reach: float
) -> dict[tuple[int, int], float]:
    """Returns the distances of the pairs that count, at least of those within reach."""
    if math.isinf(reach):
        return _first_gaps(rules, positions, airborne)
    pairs = near_pairs([(x, y) for x, y, _ in positions], reach)
    return {
        (rules.ids[one], rules.ids[other]): math.dist(positions[one], positions[other])
        for one, other in pairs
        if airborne[one] or airborne[other]
    }


def _first_gaps(
    rules: Rules, positions: Sequence[Vector], airborne: Sequence[bool]
) -> dict[tuple[int, int], float]:
    """Returns the distances of the pairs that count, the nearest among them, looking farther and farther."""
    low, high = ([extreme(axis) for axis in zip(*positions, strict=True)] for extreme in (min, max))
    reach = _FIRST_REACH
    while True:
        gaps = _gaps(rules, positions, airborne, reach)
        if reach > math.dist(low, high) or any(gap <= reach for gap in gaps.values()):
            return gaps
        reach *= 2.0


def _surface_gaps(
    flying: Iterable[tuple[int, Vector]], cylinders: Sequence[Cylinder]
) -> Iterable[tuple[tuple[int, int], float]]:
    """Yields how far each drone is from the surface of each cylinder: `(drone, index)` and m."""
    for drone, position in flying:
        for index, cylinder in enumerate(cylinders):
            yield (drone, index), cylinder.gap(position)


def _is_outside(position: Vector, fence: tuple[Vector, Vector]) -> bool:
    return any(not low <= p <= high for p, low, high in zip(position, *fence, strict=True))


def _nearest(before: Closest, gaps: Mapping[K, float], t: float) -> Closest:
    if not gaps:
        return before
    drones = min(gaps, key=gaps.__getitem__)
    return Closest(gaps[drones], drones, t) if gaps[drones] < before.distance else before
