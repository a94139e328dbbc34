"""Flight modes of one drone: GROUND -> TAKEOFF -> FOLLOW <-> HOLD -> LAND -> GROUND, STOP latched.

A pure function of what this drone knows; there is no coordinator (DESIGN section 5). Every mode can be left
except STOP.
"""

from msgspec import Struct
from msgspec.structs import replace

from shared.messages import Mode, Wish

HAND_STALE = 0.25
"""A hand older than this no longer moves anything, s."""
HAND_HOLD = 1.0
"""After this long without the hand: HOLD, s."""
HAND_LAND = 10.0
"""After this long without the hand: LAND, s."""
POSE_FRESH = 0.1
"""Take-off needs a pose at most this old, s."""
ARRIVED = 0.10
"""Take-off ends this close to the take-off height, m."""
POSE_LOST = 0.5
"""A drone in the air without a pose for this long descends open-loop, s."""
LOW_BATTERY = 0.2
"""Charge below which the operator is told ..."""
CRITICAL_BATTERY = 0.1
"""... and below which a drone lands by itself and does not take off."""
TOUCHDOWN = 0.06
"""Below this height a landing drone is on the ground, m."""

# Python takes as long to find a member in its enumeration as for a dozen sums; every step asks for these.
FOLLOW, STOP = Mode.FOLLOW, Mode.STOP
_WISH_FLY, _WISH_HOLD, _WISH_STOP = Wish.FLY, Wish.HOLD, Wish.STOP

AIRBORNE_MODES = frozenset({Mode.TAKEOFF, Mode.FOLLOW, Mode.HOLD, Mode.LAND})
_FLYING_MODES = AIRBORNE_MODES - {Mode.LAND}
GUIDED_MODES = frozenset({Mode.FOLLOW, Mode.HOLD})
"""Modes in which a drone is part of the formation and can be referred to."""
_LANDING_WISHES = frozenset({Wish.LAND, Wish.GROUND})
"""GROUND in flight means LAND."""


class ModeInputs(Struct, frozen=True):
    """What decides about the mode.

    Attributes:
        wish: The operator's newest wish, None before the first sample.
        hand_age: Time since the newest hand sample arrived, s; infinite before the first.
        pose_age: Time since the vehicle's newest pose arrived, s; infinite before the first.
        battery: Charge, 0..1.
        height: Height of the body, m; of where it should be while the pose is lost.
        takeoff_height: Height at which it joins the formation, m.
        references_follow: Every reference is in FOLLOW.
    """

    wish: Wish | None
    hand_age: float
    pose_age: float
    battery: float
    height: float
    takeoff_height: float
    references_follow: bool


class ModeState(Struct, frozen=True):
    """Mode, and whether the operator has to ask again before it may fly.

    Attributes:
        mode: The flight mode.
        must_ask_again: Set by a landing that the operator did not wish; cleared by any wish but FLY.
    """

    mode: Mode
    must_ask_again: bool = False


def initial_mode(*, airborne: bool) -> ModeState:
    """Returns the mode of a (re)started process: HOLD if its body is in the air, else GROUND."""
    return ModeState(mode=Mode.HOLD if airborne else Mode.GROUND)


def next_mode(state: ModeState, inputs: ModeInputs) -> ModeState:
    """Returns the mode after one step."""
    if state.mode is STOP or inputs.wish is _WISH_STOP:
        return replace(state, mode=Mode.STOP)
    if state.must_ask_again and inputs.hand_age <= HAND_STALE and inputs.wish is not _WISH_FLY:
        state = replace(state, must_ask_again=False)
    empty = inputs.battery <= CRITICAL_BATTERY
    if (empty or inputs.pose_age > POSE_LOST) and state.mode in _FLYING_MODES:
        return replace(state, mode=Mode.LAND, must_ask_again=empty or state.must_ask_again)
    return _NEXT[state.mode](state, inputs)


def _ground(state: ModeState, inputs: ModeInputs) -> ModeState:
    able = inputs.pose_age <= POSE_FRESH and inputs.battery > CRITICAL_BATTERY
    ready = able and _flown_by_hand(inputs) and not state.must_ask_again
    return replace(state, mode=Mode.TAKEOFF) if ready else state


def _takeoff(state: ModeState, inputs: ModeInputs) -> ModeState:
    if _landing_wished(inputs) or inputs.hand_age > HAND_LAND:
        return _land(state, inputs)
    if inputs.height >= inputs.takeoff_height - ARRIVED:
        return replace(state, mode=Mode.FOLLOW if _may_follow(inputs) else Mode.HOLD)
    return state


def _follow(state: ModeState, inputs: ModeInputs) -> ModeState:
    if _landing_wished(inputs) or inputs.hand_age > HAND_LAND:
        return _land(state, inputs)
    held = inputs.wish is _WISH_HOLD or inputs.hand_age > HAND_HOLD or not inputs.references_follow
    return replace(state, mode=Mode.HOLD) if held else state


def _hold(state: ModeState, inputs: ModeInputs) -> ModeState:
    # A process that has never heard a hand holds: whoever started it can still land it by hand or by STOP.
    silent = HAND_LAND < inputs.hand_age < float("inf")
    if _landing_wished(inputs) or silent:
        return _land(state, inputs)
    return replace(state, mode=Mode.FOLLOW) if _may_follow(inputs) else state


def _landing(state: ModeState, inputs: ModeInputs) -> ModeState:
    return replace(state, mode=Mode.GROUND) if inputs.height <= TOUCHDOWN else state


def _land(state: ModeState, inputs: ModeInputs) -> ModeState:
    wished = _landing_wished(inputs) and inputs.hand_age <= HAND_LAND
    return replace(state, mode=Mode.LAND, must_ask_again=not wished)


def _landing_wished(inputs: ModeInputs) -> bool:
    return inputs.wish in _LANDING_WISHES


def _flown_by_hand(inputs: ModeInputs) -> bool:
    return inputs.wish is _WISH_FLY and inputs.hand_age <= HAND_STALE


def _may_follow(inputs: ModeInputs) -> bool:
    return _flown_by_hand(inputs) and inputs.references_follow


_NEXT = {
    Mode.GROUND: _ground,
    Mode.TAKEOFF: _takeoff,
    Mode.FOLLOW: _follow,
    Mode.HOLD: _hold,
    Mode.LAND: _landing,
}
