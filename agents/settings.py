"""From a scenario to the settings of one drone's control law: typed once, so that flying looks nothing up."""

import functools

from agents.control.avoidance import Field
from agents.control.goals import Row
from agents.control.hand import HandSettings
from agents.control.impedance import Link, Spring
from agents.control.repair import Kin, kin_order
from agents.control.steering import Columns, SteeringSettings
from agents.control.step import Settings
from shared.fence import goal_box, hand_box
from shared.formation import Formation
from shared.messages import Vector
from shared.scenario import FieldSettings, Hand, Scenario
from shared.vehicles import vehicle_settings


def agent_settings(scenario: Scenario, formation: Formation, drone: int) -> Settings:
    """Returns the settings of one drone."""
    return Settings(
        row=drone_row(scenario, formation, drone),
        hand=hand_settings(scenario, formation),
        steering=steering_settings(scenario, formation, drone),
        stable=scenario.swarm.law == "stable",
        kin=_kin(scenario, formation, drone),
        takeoff_height=scenario.limits.takeoff_height,
        takeoff_speed=scenario.limits.takeoff_speed,
        landing_speed=scenario.limits.landing_speed,
    )


def drone_row(scenario: Scenario, formation: Formation, drone: int) -> Row:
    """Returns the row of one drone; its weights are for `[human, formation.references(drone)...]`."""
    row, references = formation.row(drone), formation.references(drone)
    weights = formation.weights[row]
    own_heights = scenario.swarm.law == "stable" or scenario.formation.height_from == "references"
    heights = [formation.rest[formation.row(other)][2] for other in references]
    return Row(
        weights=(weights.get(0, 0.0), *(weights[1 + formation.row(other)] for other in references)),
        offset=formation.offsets[row],
        links=tuple(
            Link(link.name, _spring(link.mass, link.damping, link.stiffness, link.gain), link.limit)
            for link in formation.links_into(drone)
        ),
        scale=formation.correction_scale,
        heights=None if own_heights else tuple(heights),
    )


def hand_settings(scenario: Scenario, formation: Formation) -> HandSettings:
    """Returns how the hand is mapped, with the box that keeps the whole goal formation inside the fence."""
    low, high = hand_box(scenario, formation)
    return mapping(scenario.hand, low, high, formation.radius)


def mapping(hand: Hand, low: Vector, high: Vector, radius: float) -> HandSettings:
    """Returns how the hand is mapped.

    Args:
        hand: The scenario's `[hand]`; an absolute mapping is a relative one without shift and gain.
        low: Lower corner that the mapped hand is clamped to, m.
        high: Upper corner, m.
        radius: Distance of the outermost drone at rest, m.
    """
    relative = hand.mapping == "relative"
    return HandSettings(
        gain=hand.gain if relative else 1.0,
        offset=hand.offset if relative else (0.0, 0.0, 0.0),
        height=hand.height,
        follow_yaw=hand.follow_yaw,
        max_speed=hand.max_speed,
        low=low,
        high=high,
        radius=radius,
    )


def steering_settings(scenario: Scenario, formation: Formation, drone: int) -> SteeringSettings:
    """Returns the steering settings of one drone."""
    low, high = goal_box(scenario, formation)
    return SteeringSettings(
        speed=scenario.limits.speed,
        acceleration=scenario.limits.acceleration,
        separation=field_of(scenario.avoidance.separation),
        columns=_columns(scenario),
        low=low,
        high=high,
        tau=float(vehicle_settings(scenario, drone).tau),  # type: ignore[arg-type]  # resolved: never None
        always_lead=scenario.swarm.law == "stable",
        lead_above=scenario.hand.max_speed,
    )


def field_of(settings: FieldSettings) -> Field:
    """Returns a potential field as the law takes it."""
    return Field(settings.eta, settings.d0, settings.radius)


def _columns(scenario: Scenario) -> Columns | None:
    if not scenario.obstacles:
        return None
    rules = scenario.avoidance
    return Columns(
        tuple((float(o.x), float(o.y)) for o in scenario.obstacles),
        projected=rules.rule == "projection",
        field=field_of(rules.columns),
        xi=rules.xi,
        speed=rules.speed,
        radius=rules.projection_radius,
        margin=rules.projection_margin,
    )


@functools.cache
def _spring(mass: float, damping: float, stiffness: float, gain: float) -> Spring:
    """Makes equal springs one: what one link has computed in a step the others need not compute again."""
    return Spring(mass, damping, stiffness, gain)


def _kin(scenario: Scenario, formation: Formation, drone: int) -> tuple[Kin, ...]:
    order = kin_order({each: formation.references(each) for each in formation.ids}, drone)
    return tuple(
        Kin(
            each,
            drone_row(scenario, formation, each),
            tuple(order.index(other) for other in formation.references(each)),
        )
        for each in order
    )
