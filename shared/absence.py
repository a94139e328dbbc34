"""A formation without some of its drones: their rows are put in the place of references to them.

Whoever refers to an absent drone refers to what that one refers to, with its offset; so all others keep their
places.
"""

from collections import defaultdict
from collections.abc import Collection, Sequence

from attrs import evolve

from shared.scenario import Drone


def without(drones: Sequence[Drone], absent: Collection[int]) -> list[Drone]:
    """Returns the drones that are there, none of them referring to one that is not.

    Args:
        drones: All of a formation whose references form no cycle.
        absent: Numbers of those that stay away.
    """
    rows = {str(drone.id): drone for drone in drones}
    gone = {str(number) for number in absent}
    return [_resolved(drone, rows, gone) for drone in drones if drone.id not in absent]


def _resolved(drone: Drone, rows: dict[str, Drone], gone: set[str]) -> Drone:
    while gone.intersection(drone.references):
        drone = _one_hop(drone, rows, gone)
    return drone


def _one_hop(drone: Drone, rows: dict[str, Drone], gone: set[str]) -> Drone:
    weights: defaultdict[str, float] = defaultdict(float)
    x, y, z = drone.offset
    for reference, weight in shares(drone):
        if reference not in gone:
            weights[reference] += weight
            continue
        behind = rows[reference]
        a, b, c = behind.offset
        x, y, z = x + weight * a, y + weight * b, z + weight * c
        for further, share in shares(behind):
            weights[further] += weight * share
    return evolve(drone, references=tuple(weights), weights=tuple(weights.values()), offset=(x, y, z))


def shares(drone: Drone) -> list[tuple[str, float]]:
    """Returns the references of a drone and their weights, equal ones where it gives none."""
    weights = drone.weights or (1.0 / len(drone.references),) * len(drone.references)
    return list(zip(drone.references, weights, strict=True))
