"""One central computer for all drones, instead of one agent per drone: no messages, and large swarms.

The law is the agents' own, see `deploy.lockstep.flock`.
"""

from collections.abc import Sequence
from collections.abc import Set as AbstractSet

import numpy as np
from attrs import evolve

from agents.control.hand import HandInput, MappedHand
from agents.control.safety.encounter import Clearance
from agents.control.steering import SteeringSettings
from agents.settings import clearances, drone_row, hand_settings, steering_settings, widest
from deploy.lockstep.flock import Member, advance_flock
from deploy.lockstep.hand_track import map_samples, track_of
from deploy.lockstep.record import Moment, Record, make_record
from deploy.lockstep.start import rest_places, start_flyers
from deploy.lockstep.ticks import tick_length
from shared.formation import Formation
from shared.messages import HandSample, Vector
from shared.scenario import Scenario, VehicleSettings
from shared.vehicles import vehicle_settings


class Flock:
    """A formation in FOLLOW, driven tick by tick.

    Args:
        scenario: The scenario.
        formation: Its formation.
        places: Where the drones hover at the start, in the formation's order, m.
        held: Rows that a hand holds in place.

    Attributes:
        members: The drones, in the formation's order.
        tick: Number of the next tick.
    """

    def __init__(
        self,
        scenario: Scenario,
        formation: Formation,
        places: Sequence[Vector],
        held: AbstractSet[int] = frozenset(),
    ) -> None:
        flyers = start_flyers(scenario, formation, places, airborne=True, held=held)
        flock: dict[int, Member] = {}
        steering: dict[VehicleSettings, SteeringSettings] = {}
        clearance: dict[VehicleSettings, Clearance] = {}
        for row in (row for level in formation.levels for row in level):
            drone = formation.ids[row]
            # Drones with equal vehicles steer alike.
            vehicle = evolve(vehicle_settings(scenario, drone), uri=None)
            if vehicle not in steering:
                steering[vehicle] = steering_settings(scenario, formation, drone)
                clearance[vehicle] = widest(clearances(scenario, formation, drone))
            flock[drone] = Member(
                drone_row(scenario, formation, drone),
                tuple(flock[other] for other in formation.references(drone)),
                steering[vehicle],
                clearance[vehicle],
                flyers[row],
            )
        self.members = [flock[drone] for drone in formation.ids]
        self.tick = 0
        self._flock = list(flock.values())
        self._rate = scenario.rates.control_hz
        self._stable = scenario.swarm.law == "stable"

    def advance(self, sample: HandInput, hand: MappedHand) -> None:
        """Makes one tick; what was computed is then in the members.

        Args:
            sample: The hand.
            hand: The same mapped.
        """
        dt = tick_length(self.tick - 1, self._rate) if self.tick else 1.0 / self._rate
        duration = tick_length(self.tick, self._rate)
        advance_flock(self._flock, sample, hand, dt, duration, stable=self._stable)
        self.tick += 1


def moment_of(members: Sequence[Member], formation: Formation) -> Moment:
    """Returns the last tick of a flock as arrays."""
    by_name = {
        link.name: state.displacement
        for member in members
        for link, state in zip(member.row.links, member.links, strict=True)
    }
    return Moment(
        position=np.array([member.position for member in members]),
        goal=np.array([member.goal for member in members]),
        setpoint=np.array([member.setpoint for member in members]),
        displacement=np.array([by_name[link.name] for link in formation.links]).reshape(-1, 3),
    )


def fly_central(scenario: Scenario, formation: Formation, samples: Sequence[HandSample]) -> Record:
    """Flies one hand with one central computer, from a hover in the rest formation.

    Args:
        scenario: The scenario.
        formation: Its formation.
        samples: One per tick, at least one, all with the wish FLY.

    Returns:
        The run.
    """
    hands = map_samples(samples, hand_settings(scenario, formation))
    flock = Flock(scenario, formation, rest_places(formation, hands[0][1]))
    moments = []
    for sample, hand in hands:
        flock.advance(sample, hand)
        moments.append(moment_of(flock.members, formation))
    return make_record(formation, track_of(hands), moments, formation.ids)
