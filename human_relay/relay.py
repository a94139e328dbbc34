"""The relay's core: what the source offers plus what the operator orders, made into the next hand sample.

Pure: the state is passed in and returned, and so is the time. The wish in a sample is the strongest of the
source's, the operator's and the relay's own, with STOP > LAND > HOLD > whatever the source says.
"""

from typing import NamedTuple

from human_relay.guard import GuardState, guard
from human_relay.sources.base import HandPose
from human_relay.velocity import VelocityState, step
from shared.clock import NS_PER_S
from shared.messages import MAX_POSITION, NO_HAND, ORIGIN, HandSample, Vector, Wish
from shared.topics import HAND

PERIOD_NS = round(NS_PER_S / HAND.rate_hz)

PATIENCE_NS = 5 * PERIOD_NS // 2
"""Time without a new pose after which the last one is repeated: one lost frame is not worth a repeat."""

STALE_NS = NS_PER_S // 10
"""Age of the newest pose from which on the hand counts as being at rest."""

MAX_YAW = 1_000.0
"""Largest yaw that receivers accept, rad."""

HAND_JUMP = "hand-jump"
"""By this reason the relay's status counts how often the hand has jumped."""
IMPOSSIBLE_POSE = "impossible-pose"
"""By this reason the relay's status counts the poses of its source that it has refused."""

_STRENGTH = {Wish.FLY: 0, Wish.GROUND: 0, Wish.HOLD: 1, Wish.LAND: 2, Wish.STOP: 3}


class RelayState(NamedTuple):
    """What the relay remembers.

    Attributes:
        epoch: Start of the process, ns.
        seq: Number of the next sample, which is also the number of samples so far.
        override: What the operator ordered; None leaves the wish to the source.
        pose: Last pose that was passed on; None until the first.
        guard: Whether the hand can have moved as its source says.
        velocity: Hand velocity at that pose, m/s.
        estimator: State of the velocity estimator.
        fresh_ns: When the last new pose was sent.
        sent_ns: When the last sample was sent.
        rejected: Poses of the source that were replaced: impossible, or of a hand that has jumped.
        period_ns: Between two samples, if the source has so many poses or more (`rates.hand_hz`).
        next_ns: When the next pose is due if the source has more; on average, not for each.
        judged_ns: `t_ns` of the last pose that was offered, be it impossible.
    """

    epoch: int
    seq: int = 0
    override: Wish | None = None
    pose: HandPose | None = None
    guard: GuardState = GuardState()
    velocity: Vector = ORIGIN
    estimator: VelocityState = VelocityState()
    fresh_ns: int = 0
    sent_ns: int = 0
    rejected: int = 0
    period_ns: int = PERIOD_NS
    next_ns: int = 0
    judged_ns: int | None = None


def order(state: RelayState, wish: Wish) -> RelayState:
    """Takes an order of the operator.

    STOP is final. LAND lasts until FLY. FLY lifts HOLD and LAND and gives the word back to the source.

    Args:
        state: The relay.
        wish: FLY, HOLD, LAND or STOP.
    """
    if state.override is Wish.STOP:
        return state
    if wish is Wish.FLY:
        return state._replace(override=None)
    return state._replace(override=_strongest(wish, state.override))


def has_news(state: RelayState, offered: HandPose | None) -> bool:
    """Says whether the source offers a pose that has not been sent yet."""
    return offered is not None and (state.pose is None or offered.t_ns > state.pose.t_ns)


def repeat_ns(state: RelayState) -> int:
    """Returns when a sample is due even if the source offers nothing new."""
    patience_ns = max(PATIENCE_NS, 5 * state.period_ns // 2)
    return max(state.fresh_ns + patience_ns, state.sent_ns + state.period_ns)


def due_ns(state: RelayState, offered: HandPose | None) -> int:
    """Returns when the next sample is due; of the poses that a fast source has until then, the newest is sent.

    A pose that changes the wish is due at once. Any other may come half a period early, as long as the rate is
    kept on average, so a source at about this rate does not wait, whatever its jitter; what comes earlier gives
    way to a newer one.
    """
    repeated_ns = repeat_ns(state)
    if offered is None:
        # A hand that was let go is said as soon as it cannot be a lost frame, at any rate.
        is_said = state.sent_ns > state.fresh_ns
        return repeated_ns if is_said else min(repeated_ns, state.fresh_ns + PATIENCE_NS)
    if not has_news(state, offered) or offered.t_ns == state.judged_ns:
        return repeated_ns
    if state.pose is None or offered.mode is not state.pose.mode:
        return 0
    early_ns = state.next_ns - state.period_ns // 2
    return min(repeated_ns, early_ns if offered.t_ns >= early_ns else early_ns + state.period_ns)


def make_sample(
    state: RelayState, offered: HandPose | None, now_ns: int, *, finished: bool = False
) -> tuple[RelayState, HandSample]:
    """Makes the next sample.

    Without a usable pose (released, not armed yet, impossible) the sample is the last good pose at rest with
    the wish HOLD; before the first pose it says `NO_HAND`. Of a hand that has jumped the wish counts, but for
    FLY, and the motion does not (`guard.py`).

    Args:
        state: The relay.
        offered: What the source returned.
        now_ns: Clock of the process.
        finished: Whether the source has ended; from then on the wish is at least LAND.

    Returns:
        The new state and the sample.
    """
    if offered is not None and _is_possible(offered):
        state = _take(state, offered, now_ns)
        wish = _strongest(offered.mode, Wish.HOLD if state.guard.jumped else None)
    else:
        impossible = offered is not None
        state = state._replace(velocity=ORIGIN, estimator=VelocityState(), rejected=state.rejected + impossible)
        wish = Wish.HOLD
    wish = _strongest(wish, state.override, Wish.LAND if finished else None)
    pose = state.pose
    sample = HandSample(
        epoch=state.epoch,
        seq=state.seq,
        stamp_ns=now_ns,
        position=pose.position if pose else NO_HAND,
        velocity=state.velocity,
        yaw=pose.yaw if pose else 0.0,
        mode=wish,
        jumped=state.guard.jumped,
    )
    # A STOP is final wherever it came from.
    override = Wish.STOP if wish is Wish.STOP else state.override
    judged_ns = offered.t_ns if offered is not None else state.judged_ns
    state = state._replace(seq=state.seq + 1, sent_ns=now_ns, override=override, judged_ns=judged_ns)
    return state, sample


def _take(state: RelayState, offered: HandPose, now_ns: int) -> RelayState:
    """Makes a possible pose the current one, or ages the current one if there is nothing new."""
    if not has_news(state, offered):
        is_stale = now_ns - offered.t_ns > STALE_NS
        return state._replace(velocity=ORIGIN) if is_stale else state
    guarded = guard(state.guard, offered)
    pose = guarded.passed or offered
    dt = (offered.t_ns - state.pose.t_ns) / NS_PER_S if state.pose else 0.0
    rests = guarded.jumped and state.pose is not None and pose.position == state.pose.position
    estimator, velocity = step(VelocityState() if rests else state.estimator, pose.position, dt)
    return state._replace(
        pose=pose,
        guard=guarded,
        rejected=state.rejected + guarded.jumped,
        velocity=velocity,
        estimator=estimator,
        fresh_ns=now_ns,
        next_ns=max(state.next_ns, now_ns) + state.period_ns,
    )


def _is_possible(offered: HandPose) -> bool:
    """Whether receivers would accept the pose."""
    return all(abs(x) <= MAX_POSITION for x in offered.position) and abs(offered.yaw) <= MAX_YAW


def _strongest(*wishes: Wish | None) -> Wish:
    return max((wish for wish in wishes if wish), key=_STRENGTH.__getitem__)
