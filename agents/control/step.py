"""One control step of one drone: mode, hand, links, goal, steering. State and time in, state and output out."""

import math
from collections.abc import Sequence

from attrs import frozen
from msgspec import Struct

from agents.control import modes
from agents.control.hand import HandInput, HandSettings, MappedHand, freeze, map_hand
from agents.control.modes import ModeInputs, ModeState, next_mode
from agents.control.single.avoidance import Encounter
from agents.control.single.goals import Guide, Row, goal_of
from agents.control.single.impedance import AT_REST, LinkState, step_links
from agents.control.single.repair import (
    Kin,
    Reference,
    StandIn,
    guide_of,
    guides,
    is_gone,
    replace_lost,
)
from agents.control.single.steering import Bystander, Steered, SteeringSettings, Surroundings, steer
from agents.control.single.trajectory import Trajectory, start_at
from agents.control.single.vectors import ORIGIN, Vector, norm, rotate
from agents.control.steering import LONGEST_STEP
from shared.messages import NO_FLAGS, Flag, Mode, Wish

BLOCKED_ERROR = 0.3
"""Goal error that counts as not arriving, m ..."""
BLOCKED_TIME = 2.0
"""... after this long, s."""

_JOINING_MODES = frozenset({Mode.GROUND, Mode.TAKEOFF})
_REPAIRED_MODES = modes.GUIDED_MODES | {Mode.TAKEOFF}


@frozen(kw_only=True)
class Settings:
    """Everything about one drone that does not change in flight.

    Attributes:
        row: Its row of the formation.
        hand: How the hand is mapped.
        steering: Limits and fields.
        stable: Whether references are the neighbours' goals instead of their positions.
        reference_heights: Rest heights of the references above the hand, m; None uses their actual ones.
        kin: Its ancestors in the reference graph, the references of its row first and in their order.
        takeoff_height: Where it joins the formation, m.
        takeoff_speed: m/s.
        landing_speed: m/s.
    """

    row: Row
    hand: HandSettings
    steering: SteeringSettings
    stable: bool
    reference_heights: tuple[float, ...] | None
    kin: tuple[Kin, ...]
    takeoff_height: float
    takeoff_speed: float
    landing_speed: float


class Inputs(Struct, frozen=True):
    """What one step works on.

    Attributes:
        position: Own body, m.
        velocity: Own body, m/s.
        pose_age: s.
        battery: Charge, 0..1.
        hand: Newest hand sample, None before the first.
        wish: Its wish.
        hand_age: Time since it arrived, s.
        hand_fresh: Whether it is newer than the one of the last step.
        references: What is known of each of the kin; None where never heard.
        drones: Every other drone.
        silent: Those of them that have fallen silent, where they may be by now.
    """

    position: Vector
    velocity: Vector
    pose_age: float
    battery: float
    hand: HandInput | None
    wish: Wish | None
    hand_age: float
    hand_fresh: bool
    references: tuple[Reference | None, ...]
    drones: Sequence[Encounter]
    silent: Sequence[Bystander] = ()


class State(Struct, frozen=True):
    """What one step hands to the next.

    Attributes:
        mode: Flight mode.
        hand: Mapped hand, None before the first sample.
        links: Impedance links, in the order of the row's.
        trajectory: Reference of the set-point.
        anchor: Own goal while no reference is usable, m.
        blocked_for: How long the drone has not arrived, s.
        stand_ins: How far each of the kin has been replaced; none while all speak for themselves.
    """

    mode: ModeState
    hand: MappedHand | None
    links: tuple[LinkState, ...]
    trajectory: Trajectory
    anchor: Vector
    blocked_for: float
    stand_ins: tuple[StandIn, ...]


class Output(Struct, frozen=True):
    """Result of one step: vectors in the world frame, m and m/s, and the conditions."""

    goal: Vector
    goal_velocity: Vector
    setpoint: Vector
    flags: Flag


def start(position: Vector, settings: Settings, *, airborne: bool) -> State:
    """Returns the state of a process that has just read its vehicle's pose."""
    return State(
        mode=modes.initial_mode(airborne=airborne),
        hand=None,
        links=(AT_REST,) * len(settings.row.links),
        trajectory=start_at(position),
        anchor=position,
        blocked_for=0.0,
        stand_ins=(),
    )


def step(state: State, inputs: Inputs, settings: Settings, dt: float) -> tuple[State, Output]:
    """Advances one drone by one control step.

    Args:
        state: After the last step.
        inputs: What is known now.
        settings: Of this drone.
        dt: Time since the last step, s, > 0.

    Returns:
        The state after the step, and what to publish and to send to the vehicle.
    """
    direct = len(settings.row.weights) - 1
    stand_ins = _stand_ins(state, inputs, settings, dt)
    lead = _lead(stand_ins, state.hand, inputs, settings, direct)
    mode_state = next_mode(state.mode, _mode_inputs(state, inputs, settings, lead))
    mode = mode_state.mode
    hand = _hand(state, inputs, mode, settings.hand)
    velocity = ORIGIN if hand is None else rotate(hand.velocity, -hand.yaw)
    links = step_links(state.links, settings.row.links, velocity, dt)

    if mode in modes.GUIDED_MODES and lead is not None and hand is not None:
        goal, goal_velocity = goal_of(settings.row, links, hand, lead, settings.reference_heights)
        anchor = state.trajectory.point
    else:
        anchor = goal = _own_goal(state, mode, inputs.position, settings, min(dt, LONGEST_STEP))
        goal_velocity = ORIGIN

    trajectory = state.trajectory if mode in modes.AIRBORNE_MODES else start_at(inputs.position)
    steered = steer(trajectory, goal, goal_velocity, _surroundings(inputs), settings.steering, dt)
    late = mode is modes.FOLLOW and math.dist(goal, inputs.position) > BLOCKED_ERROR
    blocked_for = state.blocked_for + dt if late else 0.0
    flags = _flags(inputs, steered, inputs.references[:direct], stand_ins[:direct], usable=lead is not None)
    if blocked_for > BLOCKED_TIME:
        flags |= Flag.BLOCKED
    after = State(mode_state, hand, links, steered.trajectory, anchor, blocked_for, stand_ins)
    return after, Output(goal, goal_velocity, steered.setpoint, flags)


def _stand_ins(state: State, inputs: Inputs, settings: Settings, dt: float) -> tuple[StandIn, ...]:
    """Replaces who is gone while there is a formation; on the ground everybody is expected to join."""
    if state.mode.mode not in _REPAIRED_MODES:
        return ()
    if not state.stand_ins and not any(map(is_gone, inputs.references)):
        return ()
    velocity = ORIGIN if state.hand is None else rotate(state.hand.velocity, -state.hand.yaw)
    return replace_lost(state.stand_ins, settings.kin, inputs.references, velocity, dt)


def _lead(
    stand_ins: tuple[StandIn, ...], hand: MappedHand | None, inputs: Inputs, settings: Settings, direct: int
) -> list[Guide] | None:
    """Returns whom to follow in the place of each reference; None if one of them has not joined yet."""
    if stand_ins and hand is not None:
        found = guides(stand_ins, settings.kin, inputs.references, direct, hand)
    else:
        # Without a hand there is no goal; all that counts is whether the references hold or follow.
        found = [guide_of(reference) for reference in inputs.references[:direct]]
    lead = []
    for guide in found:
        if guide is None:
            return None
        lead.append(guide)
    return lead


def _mode_inputs(state: State, inputs: Inputs, settings: Settings, lead: list[Guide] | None) -> ModeInputs:
    lost = inputs.pose_age > modes.POSE_LOST
    return ModeInputs(
        wish=inputs.wish,
        hand_age=inputs.hand_age,
        pose_age=inputs.pose_age,
        battery=inputs.battery,
        height=state.anchor[2] if lost else inputs.position[2],
        takeoff_height=settings.takeoff_height,
        references_follow=lead is not None and all(guide.mode is modes.FOLLOW for guide in lead),
    )


def _hand(state: State, inputs: Inputs, mode: Mode, settings: HandSettings) -> MappedHand | None:
    """Follows the hand in FOLLOW, freezes it in HOLD or silence, adopts it as it is before joining.

    Only a hand that wants to FLY is adopted: what a relay sends while it holds need not be where a hand is.
    """
    mapped, sample = state.hand, inputs.hand
    if (mapped is None or mode in _JOINING_MODES) and sample is not None and inputs.wish is Wish.FLY:
        adopted = map_hand(None, sample, settings)
        return adopted if mode is modes.FOLLOW else freeze(adopted)
    if mapped is None:
        return None
    if sample is None or mode is not modes.FOLLOW or inputs.hand_age > modes.HAND_STALE:
        return freeze(mapped)
    return map_hand(mapped, sample, settings) if inputs.hand_fresh else mapped


def _own_goal(state: State, mode: Mode, position: Vector, settings: Settings, dt: float) -> Vector:
    """Returns the goal of a drone on its own: climbing, descending, holding, or standing on the ground."""
    x, y, z = state.anchor
    if mode is Mode.TAKEOFF:
        return (x, y, max(z, min(z + settings.takeoff_speed * dt, settings.takeoff_height)))
    if mode is Mode.LAND:
        return (x, y, max(z - settings.landing_speed * dt, 0.0))
    if mode is Mode.HOLD:
        return state.anchor
    return position


def _surroundings(inputs: Inputs) -> Surroundings:
    """Returns who is around; a silent hand stays where it was, but no longer comes closer."""
    hand = inputs.hand
    if hand is None:
        return Surroundings(inputs.position, inputs.velocity, inputs.drones, None, 0.0, inputs.silent)
    x, y, _ = hand.position
    u, v, _ = velocity = hand.velocity if inputs.hand_age <= modes.HAND_STALE else ORIGIN
    return Surroundings(
        inputs.position, inputs.velocity, inputs.drones, (x, y, u, v), norm(velocity), inputs.silent
    )


def _flags(
    inputs: Inputs,
    steered: Steered,
    references: Sequence[Reference | None],
    stand_ins: Sequence[StandIn],
    *,
    usable: bool,
) -> Flag:
    flags = NO_FLAGS
    for reference in references:
        if reference is not None and not reference.fresh:
            flags |= Flag.EXTRAPOLATING
    if stand_ins and any(stand_in.share for stand_in in stand_ins):
        flags |= Flag.REPAIRED
    if not usable:
        flags |= Flag.REFERENCE_LOST
    if inputs.hand_age > modes.HAND_STALE:
        flags |= Flag.HAND_STALE
    if inputs.pose_age > modes.POSE_FRESH:
        flags |= Flag.OLD_POSE
    if inputs.battery <= modes.LOW_BATTERY:
        flags |= Flag.LOW_BATTERY
    if inputs.battery <= modes.CRITICAL_BATTERY:
        flags |= Flag.CRITICAL_BATTERY
    if steered.fenced:
        flags |= Flag.FENCE
    if steered.avoiding:
        flags |= Flag.AVOIDING
    return flags
