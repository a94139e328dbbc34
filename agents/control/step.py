"""One control step of one drone: mode, hand, links, goal, steering. State and time in, state and output out."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from attrs import frozen

from agents.control import modes
from agents.control.hand import HandInput, HandSettings, MappedHand, freeze, map_hand
from agents.control.modes import ModeInputs, ModeState, next_mode
from agents.control.single.avoidance import Encounter
from agents.control.single.goals import Row, correction, place, place_velocity, weighted
from agents.control.single.impedance import AT_REST, LinkState, step_links
from agents.control.single.steering import SteeringSettings, Surroundings, steer
from agents.control.single.trajectory import Trajectory, start_at
from agents.control.single.vectors import ORIGIN, Vector, clamp, norm, rotate
from agents.control.steering import LONGEST_STEP
from shared.messages import MAX_POSITION, MAX_VELOCITY, NO_FLAGS, Flag, Mode, Wish

REFERENCE_LOST = 0.5
"""A reference unheard for this long is lost, s."""
EXTRAPOLATION = 0.25
"""A silent reference is extrapolated by at most this, m."""
BLOCKED_ERROR = 0.3
"""Goal error that counts as not arriving, m ..."""
BLOCKED_TIME = 2.0
"""... after this long, s."""

_FARTHEST: Vector = (MAX_POSITION, MAX_POSITION, MAX_POSITION)
_FASTEST: Vector = (MAX_VELOCITY, MAX_VELOCITY, MAX_VELOCITY)


@frozen(kw_only=True)
class Settings:
    """Everything about one drone that does not change in flight.

    Attributes:
        row: Its row of the formation.
        hand: How the hand is mapped.
        steering: Limits and fields.
        stable: Whether references are the neighbours' goals instead of their positions.
        reference_heights: Rest heights of the references above the hand, m; None uses their actual ones.
        takeoff_height: Where it joins the formation, m.
        takeoff_speed: m/s.
        landing_speed: m/s.
    """

    row: Row
    hand: HandSettings
    steering: SteeringSettings
    stable: bool
    reference_heights: tuple[float, ...] | None
    takeoff_height: float
    takeoff_speed: float
    landing_speed: float


class Reference(NamedTuple):
    """A reference drone as last heard.

    Attributes:
        point: Its position (`paper`) or goal (`stable`), m.
        velocity: The rate of that, m/s.
        goal_velocity: Its broadcast goal velocity, m/s.
        mode: Its mode.
        age: Time since its sample arrived, s.
        fresh: Whether the sample is newer than the one of the last step.
    """

    point: Vector
    velocity: Vector
    goal_velocity: Vector
    mode: Mode
    age: float
    fresh: bool


class Inputs(NamedTuple):
    """What one step works on.

    Attributes:
        position: Own body, m.
        velocity: Own body, m/s.
        pose_age: s.
        hand: Newest hand sample, None before the first.
        wish: Its wish.
        hand_age: Time since it arrived, s.
        hand_fresh: Whether it is newer than the one of the last step.
        references: One per reference of the row; None where never heard.
        drones: Every other drone.
    """

    position: Vector
    velocity: Vector
    pose_age: float
    hand: HandInput | None
    wish: Wish | None
    hand_age: float
    hand_fresh: bool
    references: tuple[Reference | None, ...]
    drones: Sequence[Encounter]


class State(NamedTuple):
    """What one step hands to the next.

    Attributes:
        mode: Flight mode.
        hand: Mapped hand, None before the first sample.
        links: Impedance links, in the order of the row's.
        trajectory: Reference of the set-point.
        anchor: Own goal while no reference is usable, m.
        blocked_for: How long the drone has not arrived, s.
    """

    mode: ModeState
    hand: MappedHand | None
    links: tuple[LinkState, ...]
    trajectory: Trajectory
    anchor: Vector
    blocked_for: float


class Output(NamedTuple):
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
    usable = all(r is not None and _usable(r) for r in inputs.references)
    mode = next_mode(state.mode, _mode_inputs(inputs, settings, usable=usable))
    hand = _hand(state, inputs, mode.mode, settings.hand)
    velocity = ORIGIN if hand is None else rotate(hand.velocity, -hand.yaw)
    links = step_links(state.links, settings.row.links, velocity, dt)

    if mode.mode in modes.GUIDED_MODES and usable and hand is not None:
        goal, goal_velocity = _law(inputs, hand, links, settings)
        anchor = state.trajectory.point
    else:
        anchor = goal = _own_goal(state, mode.mode, inputs.position, settings, min(dt, LONGEST_STEP))
        goal_velocity = ORIGIN

    trajectory = state.trajectory if mode.mode in modes.AIRBORNE_MODES else start_at(inputs.position)
    steered = steer(trajectory, goal, goal_velocity, _surroundings(inputs), settings.steering, dt)
    late = mode.mode is Mode.FOLLOW and math.dist(goal, inputs.position) > BLOCKED_ERROR
    blocked_for = state.blocked_for + dt if late else 0.0
    flags = _flags(inputs, usable=usable, fenced=steered.fenced, avoiding=steered.avoiding)
    if blocked_for > BLOCKED_TIME:
        flags |= Flag.BLOCKED
    after = State(mode, hand, links, steered.trajectory, anchor, blocked_for)
    return after, Output(goal, goal_velocity, steered.setpoint, flags)


def _usable(reference: Reference) -> bool:
    return reference.age <= REFERENCE_LOST and reference.mode in modes.GUIDED_MODES


def _mode_inputs(inputs: Inputs, settings: Settings, *, usable: bool) -> ModeInputs:
    follow = usable and all(r is not None and r.mode is Mode.FOLLOW for r in inputs.references)
    return ModeInputs(
        wish=inputs.wish,
        hand_age=inputs.hand_age,
        pose_age=inputs.pose_age,
        height=inputs.position[2],
        takeoff_height=settings.takeoff_height,
        references_follow=follow,
    )


def _hand(state: State, inputs: Inputs, mode: Mode, settings: HandSettings) -> MappedHand | None:
    """Follows the hand in FOLLOW, freezes it in HOLD or silence, adopts it as it is before joining.

    Only a hand that wants to FLY is adopted: what a relay sends while it holds need not be where a hand is.
    """
    mapped, sample = state.hand, inputs.hand
    joining = mode in (Mode.GROUND, Mode.TAKEOFF)
    if sample is not None and inputs.wish is Wish.FLY and (joining or mapped is None):
        adopted = map_hand(None, sample, settings)
        return adopted if mode is Mode.FOLLOW else freeze(adopted)
    if mapped is None:
        return None
    if sample is None or mode is not Mode.FOLLOW or inputs.hand_age > modes.HAND_STALE:
        return freeze(mapped)
    return map_hand(mapped, sample, settings) if inputs.hand_fresh else mapped


def _law(
    inputs: Inputs, hand: MappedHand, links: tuple[LinkState, ...], settings: Settings
) -> tuple[Vector, Vector]:
    """Returns goal and goal velocity of this row: Eqs. 11-13, or the same on the references' goals."""
    row = settings.row
    heard = [r for r in inputs.references if r is not None]
    points = [_extrapolated(r) for r in heard]
    if settings.reference_heights is not None:
        heights = zip(points, settings.reference_heights, strict=True)
        points = [(x, y, hand.point[2] + height) for (x, y, _), height in heights]
    own, rate = correction(row, links)
    x, y, z = weighted(row, [hand.point, *points])
    u, v, w = weighted(row, [hand.velocity, *(r.goal_velocity for r in heard)])
    a, b, c = place(row, own, hand.yaw)
    d, e, f = place_velocity(row, own, rate, hand.yaw, hand.yaw_rate)
    # A goal that no receiver would accept, because a reference is at the edge of the range, helps nobody.
    return _within((x + a, y + b, z + c), _FARTHEST), _within((u + d, v + e, w + f), _FASTEST)


def _within(vector: Vector, largest: Vector) -> Vector:
    x, y, z = largest
    return clamp(vector, (-x, -y, -z), largest)


def _extrapolated(reference: Reference) -> Vector:
    """Returns where a silent reference would be by now, at most 0.25 m from where it was last."""
    if reference.fresh:
        return reference.point
    length = norm(reference.velocity) * reference.age
    seconds = reference.age if length <= EXTRAPOLATION else reference.age * (EXTRAPOLATION / length)
    (x, y, z), (u, v, w) = reference.point, reference.velocity
    return (x + u * seconds, y + v * seconds, z + w * seconds)


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
        return Surroundings(inputs.position, inputs.velocity, inputs.drones, None, 0.0)
    x, y, _ = hand.position
    u, v, _ = velocity = hand.velocity if inputs.hand_age <= modes.HAND_STALE else ORIGIN
    return Surroundings(inputs.position, inputs.velocity, inputs.drones, (x, y, u, v), norm(velocity))


def _flags(inputs: Inputs, *, usable: bool, fenced: bool, avoiding: bool) -> Flag:
    flags = NO_FLAGS
    if any(r is not None and not r.fresh for r in inputs.references):
        flags |= Flag.EXTRAPOLATING
    if not usable:
        flags |= Flag.REFERENCE_LOST
    if inputs.hand_age > modes.HAND_STALE:
        flags |= Flag.HAND_STALE
    if fenced:
        flags |= Flag.FENCE
    if avoiding:
        flags |= Flag.AVOIDING
    return flags
