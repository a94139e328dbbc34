"""From a scenario to the settings of one drone's control law, or of all of them."""

import numpy as np

from agents.control.hand import HandSettings
from agents.control.single.goals import drone_row
from agents.control.single.repair import Kin, kin_order
from agents.control.single.steering import SteeringSettings as SingleSteeringSettings
from agents.control.single.vectors import vector
from agents.control.steering import SteeringSettings
from agents.control.step import Settings
from shared.config import vehicle_settings
from shared.fence import fence_box, shape_box
from shared.formation import Formation, Vec
from shared.scenario import Scenario

UNLIMITED = 1e3


def agent_settings(scenario: Scenario, formation: Formation, drone: int) -> Settings:
    """Returns the settings of one drone."""
    return Settings(
        row=drone_row(formation, drone),
        hand=hand_settings(scenario, formation),
        steering=single_steering_settings(scenario, formation, drone),
        stable=scenario.swarm.law == "stable",
        reference_heights=_reference_heights(scenario, formation, drone),
        kin=_kin(scenario, formation, drone),
        takeoff_height=scenario.limits.takeoff_height,
        takeoff_speed=scenario.limits.takeoff_speed,
        landing_speed=scenario.limits.landing_speed,
    )


def hand_settings(scenario: Scenario, formation: Formation) -> HandSettings:
    """Returns how the hand is mapped, with the box that keeps the whole goal formation inside the fence.

    The formation may turn about the hand, so the box leaves its radius free unless the heading is fixed. The
    clip of the scenario, where there is one, replaces the box (the recorded flights clip the base alone).
    """
    hand = scenario.hand
    if hand.clip is not None:
        low = np.array([*hand.clip.min, -UNLIMITED])
        high = np.array([*hand.clip.max, UNLIMITED])
    else:
        low, high = _mapped_hand_box(scenario, formation)
    return HandSettings(hand=hand, low=vector(low), high=vector(high), radius=formation.radius)


def single_steering_settings(scenario: Scenario, formation: Formation, drone: int) -> SingleSteeringSettings:
    """Returns the steering settings of one drone."""
    low, high = _goal_box(scenario, formation)
    return SingleSteeringSettings(
        limits=scenario.limits,
        avoidance=scenario.avoidance,
        columns=tuple((o.x, o.y) for o in scenario.obstacles),
        low=vector(low),
        high=vector(high),
        tau=_tau(scenario, drone),
        always_lead=scenario.swarm.law == "stable",
        lead_above=scenario.hand.max_speed,
    )


def steering_settings(scenario: Scenario, formation: Formation, drones: tuple[int, ...]) -> SteeringSettings:
    """Returns the steering settings of some drones, one row each."""
    low, high = _goal_box(scenario, formation)
    return SteeringSettings(
        limits=scenario.limits,
        avoidance=scenario.avoidance,
        columns=np.array([(o.x, o.y) for o in scenario.obstacles]).reshape(-1, 2),
        low=low,
        high=high,
        tau=np.array([[_tau(scenario, drone)] for drone in drones]),
        always_lead=scenario.swarm.law == "stable",
        lead_above=scenario.hand.max_speed,
    )


def _tau(scenario: Scenario, drone: int) -> float:
    return float(vehicle_settings(scenario, drone).tau)  # type: ignore[arg-type]  # resolved: never None


def _reference_heights(scenario: Scenario, formation: Formation, drone: int) -> tuple[float, ...] | None:
    if scenario.swarm.law == "stable" or scenario.formation.height_from == "references":
        return None
    return tuple(float(formation.rest[formation.row(other), 2]) for other in formation.references(drone))


def _kin(scenario: Scenario, formation: Formation, drone: int) -> tuple[Kin, ...]:
    order = kin_order({each: formation.references(each) for each in formation.ids}, drone)
    return tuple(
        Kin(
            drone=each,
            row=drone_row(formation, each),
            references=tuple(order.index(other) for other in formation.references(each)),
            heights=_reference_heights(scenario, formation, each),
        )
        for each in order
    )


def _goal_box(scenario: Scenario, formation: Formation) -> tuple[Vec, Vec]:
    low, high = fence_box(scenario, formation)
    margin = scenario.fence.margin
    # The ground is no fence to keep away from: a drone lands on it.
    return low + np.array([margin, margin, 0.0]), high - margin


def _mapped_hand_box(scenario: Scenario, formation: Formation) -> tuple[Vec, Vec]:
    low, high = _goal_box(scenario, formation)
    lower, upper = shape_box(scenario, formation)
    low, high = low - lower, high - upper
    # A fence too small for the formation leaves one point: its middle.
    middle = (low + high) / 2.0
    return np.minimum(low, middle), np.maximum(high, middle)
