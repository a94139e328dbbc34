"""From a scenario to the settings of one drone's control law, or of all of them."""

import numpy as np

from agents.control.goals import agent_row
from agents.control.hand import HandSettings
from agents.control.steering import SteeringSettings
from agents.control.step import Settings
from shared.config import vehicle_settings
from shared.fence import goal_box, hand_box
from shared.formation import Formation, Vec
from shared.scenario import Scenario


def agent_settings(scenario: Scenario, formation: Formation, drone: int) -> Settings:
    """Returns the settings of one drone."""
    return Settings(
        rows=agent_row(formation, drone),
        hand=hand_settings(scenario, formation),
        steering=steering_settings(scenario, formation, (drone,)),
        stable=scenario.swarm.law == "stable",
        reference_heights=_reference_heights(scenario, formation, drone),
        takeoff_height=scenario.limits.takeoff_height,
        takeoff_speed=scenario.limits.takeoff_speed,
        landing_speed=scenario.limits.landing_speed,
    )


def hand_settings(scenario: Scenario, formation: Formation) -> HandSettings:
    """Returns how the hand is mapped, with the box that keeps the whole goal formation inside the fence."""
    low, high = hand_box(scenario, formation)
    return HandSettings(hand=scenario.hand, low=low, high=high, radius=formation.radius)


def steering_settings(scenario: Scenario, formation: Formation, drones: tuple[int, ...]) -> SteeringSettings:
    """Returns the steering settings of some drones, one row each."""
    low, high = goal_box(scenario, formation)
    return SteeringSettings(
        limits=scenario.limits,
        avoidance=scenario.avoidance,
        columns=np.array([(o.x, o.y) for o in scenario.obstacles]).reshape(-1, 2),
        low=low,
        high=high,
        tau=np.array([[vehicle_settings(scenario, drone).tau] for drone in drones], dtype=np.float64),
        always_lead=scenario.swarm.law == "stable",
        lead_above=scenario.hand.max_speed,
    )


def _reference_heights(scenario: Scenario, formation: Formation, drone: int) -> Vec | None:
    if scenario.swarm.law == "stable" or scenario.formation.height_from == "references":
        return None
    return np.array([formation.rest[formation.row(other), 2] for other in formation.references(drone)])
