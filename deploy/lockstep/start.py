"""Where a simulated run starts: bodies in the rest formation about the hand, or on the ground below it."""

from collections.abc import Sequence
from collections.abc import Set as AbstractSet

from agents.control.hand import MappedHand
from agents.control.vectors import rotate
from agents.vehicles.bodies.fleet import Flyer, hover, park_fleet
from shared.config import vehicle_settings
from shared.formation import Formation
from shared.messages import Vector
from shared.scenario import Scenario


def rest_places(formation: Formation, hand: MappedHand) -> list[Vector]:
    """Returns the places of the rest formation about a mapped hand, m."""
    (hx, hy, hz), turned = hand.point, [rotate((x, y, z), hand.yaw) for x, y, z in formation.rest]
    return [(hx + x, hy + y, hz + z) for x, y, z in turned]


def start_flyers(
    scenario: Scenario,
    formation: Formation,
    places: Sequence[Vector],
    *,
    airborne: bool,
    held: AbstractSet[int] = frozenset(),
) -> list[Flyer]:
    """Places the bodies.

    Args:
        scenario: Says which body each drone has.
        formation: Its formation.
        places: In its order, m.
        airborne: In a steady hover there, or parked on the ground below.
        held: Rows that a hand holds in place.
    """
    bodies = {drone: str(vehicle_settings(scenario, drone).body) for drone in formation.ids}
    low = [(x, y, z if airborne else 0.0) for x, y, z in places]
    parked = list(park_fleet(bodies, low).values())
    if not airborne:
        return parked
    return [hover(flyer, held=row in held) for row, flyer in enumerate(parked)]
