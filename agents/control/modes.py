"""Flight modes of one drone: GROUND -> TAKEOFF -> FOLLOW <-> HOLD -> LAND -> GROUND, STOP latched.

A pure function of what this drone knows; there is no coordinator (DESIGN section 5). Every mode can be left
except STOP.
"""

import math
from typing import Final, final

from shared.messages import Mode, Wish

HAND_STALE: Final = 0.25
"""A hand older than this no longer moves anything, s."""
HAND_HOLD: Final = 1.0
"""After this long without the hand: HOLD, s."""
HAND_LAND: Final = 10.0
"""After this long without the hand: LAND, s."""
MISSED_HOLD: Final = 0.25
"""A drone that is missed by others for this long holds where it is, s ..."""
MISSED_LAND: Final = HAND_LAND
"""... and for this long lands, s."""
POSE_FRESH: Final = 0.1
"""Take-off needs a pose at most this old, s."""
ARRIVED: Final = 0.10
"""Take-off ends this close to the take-off height, m."""
POSE_LOST: Final = 0.5
"""A drone in the air without a pose for this long descends open-loop, s."""
LOW_BATTERY: Final = 0.2
"""Charge below which the operator is told ..."""
CRITICAL_BATTERY: Final = 0.1
"""... and below which a drone lands by itself and does not take off."""
TOUCHDOWN: Final = 0.06
"""Below this height a landing drone is on the ground, m."""

# Python takes as long to find a member in its enumeration as for a dozen sums; every step asks for these.
GROUND: Final = Mode.GROUND
TAKEOFF: Final = Mode.TAKEOFF
FOLLOW: Final = Mode.FOLLOW
HOLD: Final = Mode.HOLD
LAND: Final = Mode.LAND
STOP: Final = Mode.STOP
FLY_WISH: Final = Wish.FLY
_GROUND_WISH: Final = Wish.GROUND
_HOLD_WISH: Final = Wish.HOLD
_LAND_WISH: Final = Wish.LAND
_STOP_WISH: Final = Wish.STOP


@final
class ModeInputs:
    """What decides about the mode.

    Attributes:
        wish: The operator's newest wish, None before the first sample.
        hand_age: Time since the newest hand sample arrived, s; infinite before the first.
        pose_age: Time since the vehicle's newest pose arrived, s; infinite before the first.
        battery: Charge, 0..1.
        height: Height of the body, m; of where it should be while the pose is lost.
        takeoff_height: Height at which it joins the formation, m.
        missed_for: How long others have not heard this drone, or it not them, s.
        references_follow: Every reference is in FOLLOW.
        awaiting: It does not know of everybody whom it must avoid.
        alone: It hears nobody although there are others.
    """

    def __init__(
        self,
        wish: Wish | None,
        hand_age: float,
        pose_age: float,
        battery: float,
        height: float,
        takeoff_height: float,
        missed_for: float,
        *,
        references_follow: bool,
        awaiting: bool,
        alone: bool,
    ) -> None:
        self.wish: Final = wish
        self.hand_age: Final = hand_age
        self.pose_age: Final = pose_age
        self.battery: Final = battery
        self.height: Final = height
        self.takeoff_height: Final = takeoff_height
        self.missed_for: Final = missed_for
        self.references_follow: Final = references_follow
        self.awaiting: Final = awaiting
        self.alone: Final = alone


@final
class ModeState:
    """Mode, and whether the operator has to ask again before it may fly.

    Attributes:
        mode: The flight mode.
        must_ask_again: Set by a landing that the operator did not wish; cleared by any wish but FLY.
    """

    def __init__(self, mode: Mode, *, must_ask_again: bool = False) -> None:
        self.mode: Final = mode
        self.must_ask_again: Final = must_ask_again


def is_airborne(mode: Mode) -> bool:
    """Says whether a drone in this mode is, or means to be, in the air."""
    return mode is FOLLOW or mode is HOLD or mode is TAKEOFF or mode is LAND


def is_guided(mode: Mode) -> bool:
    """Says whether a drone in this mode is part of the formation and can be referred to."""
    return mode is FOLLOW or mode is HOLD


def initial_mode(*, airborne: bool) -> ModeState:
    """Returns the mode of a (re)started process: HOLD if its body is in the air, else GROUND."""
    return ModeState(HOLD if airborne else GROUND)


def next_mode(state: ModeState, inputs: ModeInputs) -> ModeState:
    """Returns the mode after one step."""
    if state.mode is STOP or inputs.wish is _STOP_WISH:
        return _to(STOP, state)
    if state.must_ask_again and inputs.hand_age <= HAND_STALE and inputs.wish is not FLY_WISH:
        state = ModeState(state.mode)
    mode = state.mode
    empty = inputs.battery <= CRITICAL_BATTERY
    if (empty or inputs.pose_age > POSE_LOST) and is_airborne(mode) and mode is not LAND:
        return ModeState(LAND, must_ask_again=empty or state.must_ask_again)
    return _by_mode(state, inputs)


def _by_mode(state: ModeState, inputs: ModeInputs) -> ModeState:
    mode = state.mode
    if mode is FOLLOW:
        return _follow(state, inputs)
    if mode is HOLD:
        return _hold(state, inputs)
    if mode is TAKEOFF:
        return _takeoff(state, inputs)
    if mode is LAND:
        return _to(GROUND, state) if inputs.height <= TOUCHDOWN else state
    return _ground(state, inputs)


def _to(mode: Mode, state: ModeState) -> ModeState:
    return ModeState(mode, must_ask_again=state.must_ask_again)


def _ground(state: ModeState, inputs: ModeInputs) -> ModeState:
    able = inputs.pose_age <= POSE_FRESH and inputs.battery > CRITICAL_BATTERY
    in_touch = not inputs.awaiting and not inputs.alone and inputs.missed_for == 0.0
    ready = able and in_touch and _flown_by_hand(inputs) and not state.must_ask_again
    return _to(TAKEOFF, state) if ready else state


def _takeoff(state: ModeState, inputs: ModeInputs) -> ModeState:
    if _landing_wished(inputs) or inputs.hand_age > HAND_LAND or inputs.missed_for > MISSED_LAND:
        return _land(inputs)
    if inputs.height >= inputs.takeoff_height - ARRIVED:
        return _to(FOLLOW if _may_follow(inputs) else HOLD, state)
    return state


def _follow(state: ModeState, inputs: ModeInputs) -> ModeState:
    if _landing_wished(inputs) or inputs.hand_age > HAND_LAND or inputs.missed_for > MISSED_LAND:
        return _land(inputs)
    lost = inputs.awaiting or inputs.missed_for > MISSED_HOLD or inputs.hand_age > HAND_HOLD
    held = lost or inputs.wish is _HOLD_WISH or not inputs.references_follow
    return _to(HOLD, state) if held else state


def _hold(state: ModeState, inputs: ModeInputs) -> ModeState:
    # A process that has never heard a hand holds: whoever started it can still land it by hand or by STOP.
    silent = inputs.hand_age > HAND_LAND and not math.isinf(inputs.hand_age)
    if _landing_wished(inputs) or silent or inputs.missed_for > MISSED_LAND:
        return _land(inputs)
    return _to(FOLLOW, state) if _may_follow(inputs) else state


def _land(inputs: ModeInputs) -> ModeState:
    wished = _landing_wished(inputs) and inputs.hand_age <= HAND_LAND
    return ModeState(LAND, must_ask_again=not wished)


def _landing_wished(inputs: ModeInputs) -> bool:
    """GROUND in flight means LAND."""
    return inputs.wish is _LAND_WISH or inputs.wish is _GROUND_WISH


def _flown_by_hand(inputs: ModeInputs) -> bool:
    return inputs.wish is FLY_WISH and inputs.hand_age <= HAND_STALE


def _may_follow(inputs: ModeInputs) -> bool:
    in_touch = not inputs.awaiting and inputs.missed_for <= MISSED_HOLD
    return in_touch and _flown_by_hand(inputs) and inputs.references_follow
