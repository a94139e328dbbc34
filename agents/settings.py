"""From a scenario to the settings of one drone's control law: typed once, so that flying looks nothing up."""

import functools

from agents.control.avoidance import Field
from agents.control.goals import Row
from agents.control.hand import HandSettings
from agents.control.impedance import Link, Spring
from agents.control.repair import Kin, kin_order
from agents.control.safety.barrier import Curve
from agents.control.safety.demands import SafetySettings
from agents.control.safety.encounter import Berth, Clearance, column_at
from agents.control.safety.response import Response
from agents.control.steering import Columns, SteeringSettings
from agents.control.step import Settings
from shared.cylinders import columns_of
from shared.envelope import BODY, KEEP_HAND, MISSION_SHARE, AxisEnvelope, Envelope, envelope_of
from shared.fence import fence_box, goal_box, hand_box
from shared.formation import Formation
from shared.messages import Vector
from shared.scenario import FieldSettings, Hand, Scenario
from shared.vehicles import vehicle_settings

INSET = 0.02
"""Room for the steps of a discrete time, m."""
FLOOR = 0.15
"""Who flies in the formation flies no lower, m."""
HAND_INSET = 0.05
"""Room for what a hand does within a message's way, m."""
HAND_COMFORT = 0.13
"""Wished for beyond what must be kept from a hand, m."""


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
        weights=_one((weights.get(0, 0.0), *(weights[1 + formation.row(other)] for other in references))),
        offset=formation.offsets[row],
        links=tuple(
            Link(link.name, _spring(link.mass, link.damping, link.stiffness, link.gain), link.limit)
            for link in formation.links_into(drone)
        ),
        scale=formation.correction_scale,
        heights=None if own_heights else _one(tuple(heights)),
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
    envelope, own_tau = envelope_of(scenario, drone), vehicle_settings(scenario, drone).tau
    return SteeringSettings(
        speed=scenario.limits.speed,
        acceleration=_acceleration(scenario, envelope),
        separation=field_of(scenario.avoidance.separation),
        columns=_columns(scenario),
        low=low,
        high=high,
        tau=envelope.tau if own_tau is None else own_tau,
        always_lead=scenario.swarm.law == "stable",
        lead_above=scenario.hand.max_speed,
        safety=safety_settings(scenario, formation, envelope),
    )


def safety_settings(scenario: Scenario, formation: Formation, envelope: Envelope) -> SafetySettings:
    """Returns the settings of the safety filter of a drone with such a vehicle."""
    low, high = fence_box(scenario, formation)
    lowest, highest = goal_box(scenario, formation)
    across, up = envelope.horizontal, envelope.vertical
    side = min(across.tube + INSET, scenario.fence.margin)
    top = min(up.tube + INSET, scenario.fence.margin)
    clear, over = BODY + across.tube + INSET, BODY + up.tube + INSET
    return SafetySettings(
        horizontal=_response(across),
        vertical=_response(up),
        planar=Curve(across.brake, across.rate),
        upright=Curve(up.brake, up.rate),
        low=(low[0] + side, low[1] + side, max(low[2], FLOOR)),
        high=(high[0] - side, high[1] - side, high[2] - top),
        lowest=lowest,
        highest=highest,
        columns=[
            column_at(column.x, column.y, column.radius + clear, column.high + over)
            for column in columns_of(scenario)
        ],
        hand=Berth(KEEP_HAND + across.tube + HAND_INSET, HAND_COMFORT),
        over=over,
    )


def clearances(scenario: Scenario, formation: Formation, drone: int) -> dict[int, Clearance]:
    """Returns how far one drone keeps from each drone."""
    own, found = envelope_of(scenario, drone), {}
    for other in formation.ids:
        envelope = envelope_of(scenario, other)
        height = max(own.downwash.height, envelope.downwash.height)
        found[other] = Clearance(own.clearance(envelope), height, _acceleration(scenario, envelope))
    return found


def widest(found: dict[int, Clearance]) -> Clearance:
    """Returns one clearance that is enough for all."""
    return Clearance(
        max(each.distance for each in found.values()),
        max(each.height for each in found.values()),
        max(each.surprise for each in found.values()),
    )


def _response(axis: AxisEnvelope) -> Response:
    return Response(
        stiffness=axis.stiffness,
        damping=axis.damping,
        feed=axis.feed,
        lag=axis.lag,
        acceleration=axis.acceleration,
    )


def _acceleration(scenario: Scenario, envelope: Envelope) -> float:
    """Returns how hard the mission may accelerate such a vehicle, m/s^2."""
    return min(scenario.limits.acceleration, MISSION_SHARE * envelope.horizontal.acceleration)


def field_of(settings: FieldSettings) -> Field:
    """Returns a potential field as the law takes it."""
    return Field(settings.eta, settings.d0, settings.radius)


def _columns(scenario: Scenario) -> Columns | None:
    if not scenario.obstacles:
        return None
    rules = scenario.avoidance
    return Columns(
        centres=tuple((float(o.x), float(o.y)) for o in scenario.obstacles),
        projected=rules.rule == "projection",
        field=field_of(rules.columns),
        xi=rules.xi,
        speed=rules.speed,
        radius=rules.projection_radius,
        margin=rules.projection_margin,
    )


@functools.cache
def _one(values: tuple[float, ...]) -> tuple[float, ...]:
    """Makes equal tuples one: what many drones share stays in the caches of a processor."""
    return values


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
