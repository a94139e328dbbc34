"""Where a simulated run starts: bodies in the rest formation about the hand, or on the ground below it."""

from collections.abc import Iterable, Sequence
from collections.abc import Set as AbstractSet

from agents.agent import Agent
from agents.control.hand import MappedHand
from agents.control.vectors import rotate
from agents.vehicles.bodies.fleet import Flyer, hover, park_fleet, pose_of
from shared.formation import Formation
from shared.messages import ORIGIN, DroneState, Mode, Vector
from shared.scenario import Scenario
from shared.senses import Sensed
from shared.vehicles import vehicle_settings

EPOCH = 1
"""Of agents in lockstep; what they heard of each other before is older."""


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


def introduce(agents: Iterable[Agent], formation: Formation, flyers: Sequence[Flyer]) -> None:
    """Lets every agent hear everybody once, as they have on the ground before a flight begins."""
    states = [_resting(drone, flyer) for drone, flyer in zip(formation.ids, flyers, strict=True)]
    for agent in agents:
        for state in states:
            if agent.hears(state.id):
                agent.senses.hear_drone(Sensed(state, 0))


def _resting(drone: int, flyer: Flyer) -> DroneState:
    pose = pose_of(flyer, 1.0, 0)
    return DroneState(
        epoch=EPOCH - 1,
        seq=0,
        stamp_ns=0,
        id=drone,
        position=pose.position,
        velocity=ORIGIN,
        goal=pose.position,
        goal_velocity=ORIGIN,
        setpoint=pose.position,
        mode=Mode.HOLD if pose.airborne else Mode.GROUND,
    )
