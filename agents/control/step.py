"""One control step of one drone: mode, hand, links, goal, steering. State and time in, state and output out."""

import math

import numpy as np
from attrs import evolve, field, frozen

from agents.control import modes
from agents.control.avoidance import Encounters
from agents.control.goals import Rows, corrections, goal_velocities, goals, place_velocities, rotate
from agents.control.hand import HandInput, HandSettings, MappedHand, freeze, map_hand
from agents.control.impedance import LinkState, rest_state, step_links, transition_rows
from agents.control.modes import ModeInputs, ModeState, next_mode
from agents.control.steering import LONGEST_STEP, SteeringSettings, Surroundings, steer
from agents.control.trajectory import Trajectory, start_at
from shared.formation import Vec
from shared.messages import MAX_POSITION, MAX_VELOCITY, Flag, Mode, Wish

REFERENCE_LOST = 0.5
"""A reference unheard for this long is lost, s."""
EXTRAPOLATION = 0.25
"""A silent reference is extrapolated by at most this, m."""
BLOCKED_ERROR = 0.3
"""Goal error that counts as not arriving, m ..."""
BLOCKED_TIME = 2.0
"""... after this long, s."""


@frozen(kw_only=True)
class Settings:
    """Everything about one drone that does not change in flight.

    Attributes:
        rows: Its row of the formation.
        hand: How the hand is mapped.
        steering: Limits and fields.
        stable: Whether references are the neighbours' goals instead of their positions.
        reference_heights: (m,) rest heights of the references above the hand, m; None uses their actual ones.
        takeoff_height: Where it joins the formation, m.
        takeoff_speed: m/s.
        landing_speed: m/s.
    """

    rows: Rows
    hand: HandSettings
    steering: SteeringSettings
    stable: bool
    reference_heights: Vec | None = field(eq=False)
    takeoff_height: float
    takeoff_speed: float
    landing_speed: float


@frozen(kw_only=True)
class Reference:
    """A reference drone as last heard.

    Attributes:
        point: (3,) its position (`paper`) or goal (`stable`), m.
        velocity: (3,) the rate of that, m/s.
        goal_velocity: (3,) its broadcast goal velocity, m/s.
        mode: Its mode.
        age: Time since its sample arrived, s.
        fresh: Whether the sample is newer than the one of the last step.
    """

    point: Vec = field(eq=False)
    velocity: Vec = field(eq=False)
    goal_velocity: Vec = field(eq=False)
    mode: Mode
    age: float
    fresh: bool


@frozen(kw_only=True)
class Inputs:
    """What one step works on.

    Attributes:
        position: (3,) own body, m.
        velocity: (3,) own body, m/s.
        pose_age: s.
        hand: Newest hand sample, None before the first.
        wish: Its wish.
        hand_age: Time since it arrived, s.
        hand_fresh: Whether it is newer than the one of the last step.
        references: One per reference of the row; None where never heard.
        drones: Every other drone.
    """

    position: Vec = field(eq=False)
    velocity: Vec = field(eq=False)
    pose_age: float
    hand: HandInput | None
    wish: Wish | None
    hand_age: float
    hand_fresh: bool
    references: tuple[Reference | None, ...]
    drones: Encounters


@frozen(kw_only=True)
class State:
    """What one step hands to the next.

    Attributes:
        mode: Flight mode.
        hand: Mapped hand, None before the first sample.
        links: Impedance links.
        trajectory: Reference of the set-point.
        anchor: (3,) own goal while no reference is usable, m.
        blocked_for: How long the drone has not arrived, s.
    """

    mode: ModeState
    hand: MappedHand | None
    links: LinkState
    trajectory: Trajectory
    anchor: Vec = field(eq=False)
    blocked_for: float


@frozen(kw_only=True)
class Output:
    """Result of one step: (3,) vectors in the world frame, m and m/s, and the conditions."""

    goal: Vec = field(eq=False)
    goal_velocity: Vec = field(eq=False)
    setpoint: Vec = field(eq=False)
    flags: Flag


def start(position: Vec, settings: Settings, *, airborne: bool) -> State:
    """Returns the state of a process that has just read its vehicle's pose."""
    return State(
        mode=modes.initial_mode(airborne=airborne),
        hand=None,
        links=rest_state(len(settings.rows.links)),
        trajectory=start_at(position[None, :]),
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
    velocity = np.zeros(3) if hand is None else rotate(hand.velocity, -hand.yaw)
    links = step_links(state.links, transition_rows(settings.rows.links, dt), velocity)

    guided = mode.mode in modes.GUIDED_MODES and usable and hand is not None
    if guided and hand is not None:
        goal, goal_velocity = _law(inputs, hand, links, settings)
        anchor = state.trajectory.point[0]
    else:
        anchor = goal = _own_goal(state, mode.mode, inputs.position, settings, min(dt, LONGEST_STEP))
        goal_velocity = np.zeros(3)

    trajectory = state.trajectory if mode.mode in modes.AIRBORNE_MODES else start_at(inputs.position[None, :])
    around = _surroundings(inputs)
    steered = steer(trajectory, goal[None, :], goal_velocity[None, :], around, settings.steering, dt)
    error = math.dist(goal, inputs.position)
    late = mode.mode is Mode.FOLLOW and error > BLOCKED_ERROR
    blocked_for = state.blocked_for + dt if late else 0.0
    flags = _flags(inputs, usable=usable, fenced=bool(steered.fenced[0]), avoiding=bool(steered.avoiding[0]))
    if blocked_for > BLOCKED_TIME:
        flags |= Flag.BLOCKED
    after = State(
        mode=mode,
        hand=hand,
        links=links,
        trajectory=steered.trajectory,
        anchor=anchor,
        blocked_for=blocked_for,
    )
    return after, Output(goal=goal, goal_velocity=goal_velocity, setpoint=steered.setpoint[0], flags=flags)


def _usable(reference: Reference) -> bool:
    return reference.age <= REFERENCE_LOST and reference.mode in modes.GUIDED_MODES


def _mode_inputs(inputs: Inputs, settings: Settings, *, usable: bool) -> ModeInputs:
    follow = usable and all(r is not None and r.mode is Mode.FOLLOW for r in inputs.references)
    return ModeInputs(
        wish=inputs.wish,
        hand_age=inputs.hand_age,
        pose_age=inputs.pose_age,
        height=float(inputs.position[2]),
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


def _law(inputs: Inputs, hand: MappedHand, links: LinkState, settings: Settings) -> tuple[Vec, Vec]:
    """Returns goal and goal velocity (3,) of this row: Eqs. 11-13, or the same on the references' goals."""
    rows = settings.rows
    heard = [r for r in inputs.references if r is not None]
    points = np.array([hand.point, *(_extrapolated(r) for r in heard)])
    if settings.reference_heights is not None:
        points[1:, 2] = hand.point[2] + settings.reference_heights
    velocities = np.array([hand.velocity, *(r.goal_velocity for r in heard)])
    correction, rate = corrections(rows, links)
    goal = goals(rows, points, correction, hand.yaw)
    places = place_velocities(rows, correction, rate, hand.yaw, hand.yaw_rate)
    goal_velocity = goal_velocities(rows, velocities, places)
    # A goal that no receiver would accept, because a reference is at the edge of the range, helps nobody.
    return _within(goal[0], MAX_POSITION), _within(goal_velocity[0], MAX_VELOCITY)


def _within(vector: Vec, largest: float) -> Vec:
    return np.minimum(np.maximum(vector, -largest), largest)


def _extrapolated(reference: Reference) -> Vec:
    """Returns where a silent reference would be by now, at most 0.25 m from where it was last."""
    if reference.fresh:
        return reference.point
    way = reference.velocity * reference.age
    length = math.sqrt(way @ way)
    return reference.point + (way if length <= EXTRAPOLATION else way * (EXTRAPOLATION / length))


def _own_goal(state: State, mode: Mode, position: Vec, settings: Settings, dt: float) -> Vec:
    """Returns the goal of a drone on its own: climbing, descending, holding, or standing on the ground."""
    x, y, z = state.anchor
    if mode is Mode.TAKEOFF:
        return np.array([x, y, max(z, min(z + settings.takeoff_speed * dt, settings.takeoff_height))])
    if mode is Mode.LAND:
        return np.array([x, y, max(z - settings.landing_speed * dt, 0.0)])
    if mode is Mode.HOLD:
        return state.anchor
    return position


def _surroundings(inputs: Inputs) -> Surroundings:
    """Returns who is around; a silent hand stays where it was, but no longer comes closer."""
    around = Surroundings(
        position=inputs.position[None, :],
        velocity=inputs.velocity[None, :],
        drones=inputs.drones,
        hand=None,
        hand_speed=0.0,
    )
    if inputs.hand is None:
        return around
    velocity = inputs.hand.velocity if inputs.hand_age <= modes.HAND_STALE else np.zeros(3)
    hand = Encounters(
        row=np.zeros(1, dtype=np.intp), position=inputs.hand.position[None, :2], velocity=velocity[None, :2]
    )
    return evolve(around, hand=hand, hand_speed=math.sqrt(velocity @ velocity))


def _flags(inputs: Inputs, *, usable: bool, fenced: bool, avoiding: bool) -> Flag:
    flags = Flag(0)
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
