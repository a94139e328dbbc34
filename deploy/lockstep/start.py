"""Where a simulated run starts: bodies in the rest formation about the hand, or on the ground below it."""

from collections.abc import Set as AbstractSet

import numpy as np

from agents.control.goals import rotate
from agents.vehicles.bodies.fleet import Fleet, hold, hover_fleet, park_fleet
from deploy.lockstep.hand_track import HandTrack
from shared.config import vehicle_settings
from shared.formation import Formation, Vec
from shared.scenario import Scenario


def rest_places(formation: Formation, hand: HandTrack) -> Vec:
    """Returns the places (N, 3) of the rest formation about the first mapped hand, m."""
    places: Vec = hand.point[0] + rotate(formation.rest, float(hand.yaw[0]))
    return places


def start_fleet(
    scenario: Scenario,
    formation: Formation,
    places: Vec,
    *,
    airborne: bool,
    held: AbstractSet[int] = frozenset(),
) -> Fleet:
    """Places the bodies.

    Args:
        scenario: Says which body each drone has.
        formation: Its formation.
        places: (k N, 3) m, the formation once or several times.
        airborne: In a steady hover there, or parked on the ground below.
        held: Rows that a hand holds in place, counted from 1.
    """
    bodies = [str(vehicle_settings(scenario, drone).body) for drone in formation.ids]
    copies = len(places) // len(bodies)
    numbered = dict(enumerate(bodies * copies, start=1))
    fleet = park_fleet(numbered, places if airborne else places * np.array([1.0, 1.0, 0.0]))
    return hold(hover_fleet(fleet) if airborne else fleet, held)
