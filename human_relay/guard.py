"""Whether a hand can have moved as its source says: one that jumps is released until it is plausible again.

Pure: the state is passed in and returned. A tracker that swaps two bodies, loses a marker or starts anew puts
the hand somewhere else from one pose to the next; drones that avoid a hand, or follow it, cannot do so.
A pose that no hand could have reached is not passed on: the hand rests where it was believed last. It is
plausible again as soon as it is back there, or has moved like a hand for `PROOF_S` wherever it is now. Then the
hand that is passed on walks there, no faster than drones can evade it.
"""

import math
from typing import NamedTuple

from attrs import evolve

from human_relay.sources.base import HandPose
from human_relay.velocity import MAX_GAP, MAX_SPEED
from shared.clock import NS_PER_S
from shared.messages import Vector

SLACK = 0.05
"""Noise of a tracker, and a hand whose poses were held up, m."""
PROOF_S = 0.3
"""So long a hand moves like one in a new place before it is believed there, s."""
WALK = 1.5
"""Speed of the way there, m/s."""


class GuardState(NamedTuple):
    """What is believed of the hand.

    Attributes:
        passed: Newest pose that was passed on, None before the first.
        offered: Newest pose of the source while it is not believed, or walked to; None while all is well.
        since_ns: Since when the offered poses move like a hand.
        jumps: How often the hand has jumped.
    """

    passed: HandPose | None = None
    offered: HandPose | None = None
    since_ns: int = 0
    jumps: int = 0

    @property
    def jumped(self) -> bool:
        """Whether the hand is not where the source says."""
        return self.offered is not None


def guard(state: GuardState, pose: HandPose) -> GuardState:
    """Takes in one new pose of the source.

    Args:
        state: Before.
        pose: Later than the last one.

    Returns:
        The state after; `passed` is what to pass on now.
    """
    if state.passed is None or (state.offered is None and _follows(state.passed, pose)):
        return state._replace(passed=pose, offered=None)
    if state.offered is None:
        return _doubt(state, pose)._replace(jumps=state.jumps + 1)
    is_back = _follows(state.passed, pose)
    if not is_back and not _follows(state.offered, pose):
        return _doubt(state, pose)
    if not is_back and pose.t_ns - state.since_ns < PROOF_S * NS_PER_S:
        return state._replace(passed=_rest(state.passed, pose), offered=pose)
    walked = _walk(state.passed, pose)
    return state._replace(passed=walked, offered=None if walked is pose else pose)


def _doubt(state: GuardState, pose: HandPose) -> GuardState:
    rests = None if state.passed is None else _rest(state.passed, pose)
    return state._replace(passed=rests, offered=pose, since_ns=pose.t_ns)


def _follows(last: HandPose, pose: HandPose) -> bool:
    """Says whether a hand can have moved from one pose to the next; a gap grants no further way."""
    seconds = min((pose.t_ns - last.t_ns) / NS_PER_S, MAX_GAP)
    return math.dist(last.position, pose.position) <= MAX_SPEED * seconds + SLACK


def _rest(passed: HandPose, pose: HandPose) -> HandPose:
    """Returns the hand where it was; what the source wishes counts all the same."""
    return evolve(passed, mode=pose.mode, t_ns=pose.t_ns)


def _walk(passed: HandPose, pose: HandPose) -> HandPose:
    """Returns the next pose on the way; the heading is taken over at its end."""
    reach = WALK * min((pose.t_ns - passed.t_ns) / NS_PER_S, MAX_GAP)
    way = math.dist(passed.position, pose.position)
    if way <= reach:
        return pose
    share = reach / way
    (x, y, z), (a, b, c) = passed.position, pose.position
    place: Vector = (x + share * (a - x), y + share * (b - y), z + share * (c - z))
    return evolve(passed, position=place, mode=pose.mode, t_ns=pose.t_ns)
