"""One control step of one drone: mode, hand, links, goal, steering. State and time in, state and output out."""

from dataclasses import dataclass
from typing import Final, final

from mypy_extensions import mypyc_attr

from agents.control import modes
from agents.control.goals import Guide, Row, goal_of
from agents.control.hand import HandInput, HandSettings, MappedHand, freeze, map_hand
from agents.control.impedance import AT_REST, LinkState, step_links
from agents.control.modes import ModeInputs, ModeState, next_mode
from agents.control.repair import Kin, Reference, StandIn, all_follow, guide_of, guides, is_gone, replace_lost
from agents.control.safety.demands import SafetySettings
from agents.control.safety.encounter import Encounter, walker_seen
from agents.control.safety.motion import Motion, start_motion, watch
from agents.control.steering import (
    LONGEST_STEP,
    Steered,
    SteeringSettings,
    Surroundings,
    steer,
)
from agents.control.trajectory import Trajectory, start_at
from agents.control.vectors import ORIGIN, Vector, distance, norm, rotate
from shared.messages import Flag, Mode, Wish

BLOCKED_ERROR: Final = 0.3
"""Goal error that counts as not arriving, m ..."""
BLOCKED_TIME: Final = 2.0
"""... after this long, s."""

# As plain numbers: Python takes longer to combine two members of an enumeration than for all of `_flags`.
EXTRAPOLATING: Final[int] = Flag.EXTRAPOLATING.value
REPAIRED: Final[int] = Flag.REPAIRED.value
BLOCKED: Final[int] = Flag.BLOCKED.value
FENCE: Final[int] = Flag.FENCE.value
LOW_BATTERY: Final[int] = Flag.LOW_BATTERY.value
CRITICAL_BATTERY: Final[int] = Flag.CRITICAL_BATTERY.value
OLD_POSE: Final[int] = Flag.OLD_POSE.value
HAND_STALE: Final[int] = Flag.HAND_STALE.value
REFERENCE_LOST: Final[int] = Flag.REFERENCE_LOST.value
AVOIDING: Final[int] = Flag.AVOIDING.value
WAITING: Final[int] = Flag.WAITING.value
MISSED: Final[int] = Flag.MISSED.value


@final
@dataclass(frozen=True, kw_only=True)
class Settings:
    """Everything about one drone that does not change in flight.

    Attributes:
        row: Its row of the formation.
        hand: How the hand is mapped.
        steering: Limits and fields.
        stable: Whether references are the neighbours' goals instead of their positions.
        kin: Its ancestors in the reference graph, the references of its row first and in their order.
        takeoff_height: Where it joins the formation, m.
        takeoff_speed: m/s.
        landing_speed: m/s.
    """

    row: Row
    hand: HandSettings
    steering: SteeringSettings
    stable: bool
    kin: tuple[Kin, ...]
    takeoff_height: float
    takeoff_speed: float
    landing_speed: float


@mypyc_attr(acyclic=True, free_list_len=1)
@final
class Inputs:
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
        obstacles: Whatever else moves about and does not look.
        missed: Others do not hear this drone, or it does not hear them.
        awaiting: It does not know of everybody whom it must avoid.
        alone: It hears nobody although there are others.
    """

    def __init__(
        self,
        *,
        position: Vector,
        velocity: Vector,
        pose_age: float,
        battery: float,
        hand: HandInput | None,
        wish: Wish | None,
        hand_age: float,
        hand_fresh: bool,
        references: list[Reference | None],
        drones: list[Encounter],
        obstacles: list[Encounter],
        missed: bool,
        awaiting: bool,
        alone: bool,
    ) -> None:
        self.position: Final = position
        self.velocity: Final = velocity
        self.pose_age: Final = pose_age
        self.battery: Final = battery
        self.hand: Final = hand
        self.wish: Final = wish
        self.hand_age: Final = hand_age
        self.hand_fresh: Final = hand_fresh
        self.references: Final = references
        self.drones: Final = drones
        self.obstacles: Final = obstacles
        self.missed: Final = missed
        self.awaiting: Final = awaiting
        self.alone: Final = alone


@mypyc_attr(acyclic=True)
@final
class State:
    """What one step hands to the next.

    Attributes:
        mode: Flight mode.
        hand: Mapped hand, None before the first sample.
        links: Impedance links, in the order of the row's.
        trajectory: Reference of the set-point.
        motion: What is known about the own body.
        anchor: Own goal while no reference is usable, m.
        blocked_for: How long the drone has not arrived, s.
        missed_for: How long others have not heard it, or it not them, s.
        stand_ins: How far each of the kin has been replaced; none while all speak for themselves.
    """

    def __init__(
        self,
        mode: ModeState,
        hand: MappedHand | None,
        links: tuple[LinkState, ...],
        trajectory: Trajectory,
        motion: Motion,
        anchor: Vector,
        blocked_for: float,
        missed_for: float,
        stand_ins: tuple[StandIn, ...],
    ) -> None:
        self.mode: Final = mode
        self.hand: Final = hand
        self.links: Final = links
        self.trajectory: Final = trajectory
        self.motion: Final = motion
        self.anchor: Final = anchor
        self.blocked_for: Final = blocked_for
        self.missed_for: Final = missed_for
        self.stand_ins: Final = stand_ins


@mypyc_attr(acyclic=True, free_list_len=1)
@final
class Output:
    """Result of one step.

    Attributes:
        goal: m.
        goal_velocity: m/s.
        setpoint: m.
        ahead: Point ahead of the own body, m.
        pace: Its velocity, m/s.
        asked: Its acceleration, m/s^2.
        flags: Conditions, bits of `Flag`.
    """

    def __init__(
        self,
        goal: Vector,
        goal_velocity: Vector,
        setpoint: Vector,
        ahead: Vector,
        pace: Vector,
        asked: Vector,
        flags: int,
    ) -> None:
        self.goal: Final = goal
        self.goal_velocity: Final = goal_velocity
        self.ahead: Final = ahead
        self.pace: Final = pace
        self.asked: Final = asked
        self.setpoint: Final = setpoint
        self.flags: Final = flags


def start(position: Vector, settings: Settings, *, airborne: bool) -> State:
    """Returns the state of a process that has just read its vehicle's pose."""
    return State(
        mode=modes.initial_mode(airborne=airborne),
        hand=None,
        links=(AT_REST,) * len(settings.row.links),
        trajectory=start_at(position),
        motion=start_motion(position, ORIGIN, 0.0),
        anchor=position,
        blocked_for=0.0,
        missed_for=0.0,
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
    missed_for = state.missed_for + dt if inputs.missed else 0.0
    mode_state = next_mode(state.mode, _mode_inputs(state, inputs, settings, lead, missed_for))
    mode = mode_state.mode
    hand = _hand(state, inputs, mode, settings.hand)
    velocity = ORIGIN if hand is None else rotate(hand.velocity, -hand.yaw)
    links = step_links(state.links, settings.row.links, velocity, dt)

    # Who is missed stays where the others saw it last.
    in_touch = missed_for <= modes.MISSED_HOLD
    if modes.is_guided(mode) and in_touch and lead is not None and hand is not None:
        goal, goal_velocity = goal_of(settings.row, links, hand, lead)
        anchor = state.trajectory.point
    else:
        anchor = goal = _own_goal(state, mode, inputs.position, settings, min(dt, LONGEST_STEP))
        goal_velocity = ORIGIN

    trajectory, motion = state.trajectory, _motion(state, inputs, settings, dt)
    if not modes.is_airborne(mode):
        trajectory = start_at(inputs.position)
    around = _surroundings(inputs, settings.steering.safety)
    floor = modes.is_guided(mode)
    steered = steer(trajectory, motion, goal, goal_velocity, around, settings.steering, dt, floor=floor)
    guarded = steered.guarded
    late = mode is modes.FOLLOW and distance(goal, inputs.position) > BLOCKED_ERROR
    blocked_for = state.blocked_for + dt if late else 0.0
    flags = _flags(inputs, steered, stand_ins, direct, usable=lead is not None)
    if blocked_for > BLOCKED_TIME:
        flags |= BLOCKED
    if not in_touch:
        flags |= MISSED
    after = State(
        mode_state, hand, links, steered.trajectory, guarded.motion, anchor, blocked_for, missed_for, stand_ins
    )
    return after, Output(
        goal, goal_velocity, guarded.setpoint, guarded.ahead, guarded.pace, guarded.asked, flags
    )


def _motion(state: State, inputs: Inputs, settings: Settings, dt: float) -> Motion:
    """Takes in the pose; a body on the ground goes nowhere, whatever it is told."""
    if not modes.is_airborne(state.mode.mode):
        return start_motion(inputs.position, inputs.velocity, inputs.pose_age)
    safety = settings.steering.safety
    across, up = safety.horizontal, safety.vertical
    return watch(state.motion, inputs.position, inputs.velocity, inputs.pose_age, dt, across, up)


def _stand_ins(state: State, inputs: Inputs, settings: Settings, dt: float) -> tuple[StandIn, ...]:
    """Replaces who is gone while there is a formation; on the ground everybody is expected to join."""
    mode = state.mode.mode
    if not (modes.is_guided(mode) or mode is modes.TAKEOFF):
        return ()
    if not state.stand_ins and not _any_gone(inputs.references):
        return ()
    velocity = ORIGIN if state.hand is None else rotate(state.hand.velocity, -state.hand.yaw)
    return replace_lost(state.stand_ins, settings.kin, inputs.references, velocity, dt)


def _any_gone(references: list[Reference | None]) -> bool:
    return any(is_gone(reference) for reference in references)


def _lead(
    stand_ins: tuple[StandIn, ...], hand: MappedHand | None, inputs: Inputs, settings: Settings, direct: int
) -> list[Guide] | None:
    """Returns whom to follow in the place of each reference; None if one of them has not joined yet."""
    if stand_ins and hand is not None:
        found = guides(stand_ins, settings.kin, inputs.references, direct, hand)
    else:
        # Without a hand there is no goal; all that counts is whether the references hold or follow.
        found = [guide_of(inputs.references[place]) for place in range(direct)]
    lead: list[Guide] = []
    for guide in found:
        if guide is None:
            return None
        lead.append(guide)
    return lead


def _mode_inputs(
    state: State, inputs: Inputs, settings: Settings, lead: list[Guide] | None, missed_for: float
) -> ModeInputs:
    lost = inputs.pose_age > modes.POSE_LOST
    return ModeInputs(
        inputs.wish,
        inputs.hand_age,
        inputs.pose_age,
        inputs.battery,
        state.anchor[2] if lost else inputs.position[2],
        settings.takeoff_height,
        missed_for,
        references_follow=lead is not None and all_follow(lead),
        awaiting=inputs.awaiting,
        alone=inputs.alone,
    )


def _hand(state: State, inputs: Inputs, mode: Mode, settings: HandSettings) -> MappedHand | None:
    """Follows the hand in FOLLOW, freezes it in HOLD or silence, adopts it as it is before joining.

    Only a hand that wants to FLY is adopted: what a relay sends while it holds need not be where a hand is.
    """
    mapped, sample = state.hand, inputs.hand
    joining = mode is modes.GROUND or mode is modes.TAKEOFF
    if (mapped is None or joining) and sample is not None and inputs.wish is modes.FLY_WISH:
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
    if mode is modes.TAKEOFF:
        return (x, y, max(z, min(z + settings.takeoff_speed * dt, settings.takeoff_height)))
    if mode is modes.LAND:
        return (x, y, max(z - settings.landing_speed * dt, 0.0))
    if mode is modes.HOLD:
        return state.anchor
    return position


def _surroundings(inputs: Inputs, safety: SafetySettings) -> Surroundings:
    """Returns who is around; a silent hand stays where it was, but no longer comes closer."""
    hand = inputs.hand
    if hand is None:
        return Surroundings(inputs.drones, inputs.obstacles, 0.0)
    velocity, age = hand.velocity, inputs.hand_age
    if age > modes.HAND_STALE:
        velocity, age = ORIGIN, 0.0
    seen = walker_seen(hand.position, velocity, age, safety.horizontal.lag, safety.hand)
    return Surroundings(inputs.drones, [seen, *inputs.obstacles], norm(velocity))


def _flags(
    inputs: Inputs, steered: Steered, stand_ins: tuple[StandIn, ...], direct: int, *, usable: bool
) -> int:
    flags = 0
    for place in range(direct):
        reference = inputs.references[place]
        if reference is not None and not reference.fresh:
            flags |= EXTRAPOLATING
        if stand_ins and stand_ins[place].share > 0.0:
            flags |= REPAIRED
    if not usable:
        flags |= REFERENCE_LOST
    if inputs.hand_age > modes.HAND_STALE:
        flags |= HAND_STALE
    if inputs.pose_age > modes.POSE_FRESH:
        flags |= OLD_POSE
    if inputs.battery <= modes.LOW_BATTERY:
        flags |= LOW_BATTERY
    if inputs.battery <= modes.CRITICAL_BATTERY:
        flags |= CRITICAL_BATTERY
    if steered.fenced:
        flags |= FENCE
    if steered.avoiding:
        flags |= AVOIDING
    if inputs.awaiting or inputs.alone:
        flags |= WAITING
    return flags
