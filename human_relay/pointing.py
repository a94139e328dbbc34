"""A hand that is pointed to: who holds it, and how it follows what it is pointed at. Pure.

A pointer can jump, a hand cannot: the hand follows its target with bounded speed and acceleration, braking in
time, and stays where it is while nobody holds it.
"""

import math

from attrs import evolve, frozen

from shared.clock import NS_PER_S
from shared.messages import Vector, Wish
from shared.pointer_link import SILENT_S, WISHES, Pointed, Verb

LONGEST_STEP = 0.1
"""A loop that was held up longer moves the hand no further than this long, s."""

_SILENT_NS = round(SILENT_S * NS_PER_S)
_BRAKING = 0.8
"""Share of the acceleration limit that braking plans with; the rest is for finite steps."""


@frozen(kw_only=True)
class Limits:
    """Bounds of the hand's motion.

    Attributes:
        speed: m/s.
        acceleration: m/s^2.
    """

    speed: float
    acceleration: float


@frozen(kw_only=True)
class PointerState:
    """What is known about a pointed hand.

    Attributes:
        sender: Console whose page holds the hand, None while nobody does.
        held_ns: When the holder was last heard.
        heard_ns: When any console was last heard, None before the first.
        target: Where the holder points, m.
        yaw: Where it turns to, rad.
        wish: What it wants.
        position: The hand, None before the first time that it was held.
        velocity: Of the hand, m/s.
        moved_ns: When the hand was last moved.
        stopped: Whether somebody has said STOP.
    """

    sender: int | None = None
    held_ns: int = 0
    heard_ns: int | None = None
    target: Vector | None = None
    yaw: float = 0.0
    wish: Wish = Wish.GROUND
    position: Vector | None = None
    velocity: Vector = (0.0, 0.0, 0.0)
    moved_ns: int = 0
    stopped: bool = False


def hear(state: PointerState, pointed: Pointed, now_ns: int) -> PointerState:
    """Takes one datagram: the first console that holds the hand keeps it until it lets go or falls silent.

    Args:
        state: What is known.
        pointed: The datagram.
        now_ns: When it was read.
    """
    state = evolve(expire(state, now_ns), heard_ns=now_ns)
    if pointed.verb is Verb.STOP:
        state = evolve(state, stopped=True)
    if state.sender not in (None, pointed.sender):
        return state
    if pointed.verb is Verb.RELEASED:
        return evolve(state, sender=None)
    return evolve(
        state,
        sender=pointed.sender,
        held_ns=now_ns,
        target=pointed.position,
        yaw=pointed.yaw,
        wish=WISHES[pointed.verb],
    )


def expire(state: PointerState, now_ns: int) -> PointerState:
    """Lets go of the hand for a holder that has fallen silent."""
    return evolve(state, sender=None) if now_ns - state.held_ns > _SILENT_NS else state


def is_watched(state: PointerState, now_ns: int) -> bool:
    """Says whether pages are open, whether they hold the hand or not."""
    return state.heard_ns is not None and now_ns - state.heard_ns <= _SILENT_NS


def advance(state: PointerState, now_ns: int, limits: Limits) -> PointerState:
    """Moves the hand on to now; it rests while nobody holds it, and in HOLD and STOP.

    Args:
        state: What is known.
        now_ns: The time.
        limits: Bounds of the motion.
    """
    dt = min((now_ns - state.moved_ns) / NS_PER_S, LONGEST_STEP)
    state = evolve(expire(state, now_ns), moved_ns=now_ns)
    if state.sender is None or state.target is None or state.stopped or state.wish is Wish.HOLD:
        return evolve(state, velocity=(0.0, 0.0, 0.0))
    if state.position is None:
        return evolve(state, position=state.target)
    position, velocity = pursue(state.position, state.velocity, state.target, dt, limits)
    return evolve(state, position=position, velocity=velocity)


def pursue(
    position: Vector, velocity: Vector, target: Vector, dt: float, limits: Limits
) -> tuple[Vector, Vector]:
    """Moves a point towards a target that it can still stop at.

    Args:
        position: m.
        velocity: m/s.
        target: m.
        dt: s, >= 0.
        limits: Bounds.

    Returns:
        Position and velocity after `dt`.
    """
    if dt <= 0.0:
        return position, velocity
    (x, y, z), (u, v, w), (a, b, c) = position, velocity, target
    distance = math.dist(position, target)
    stoppable = math.sqrt(2.0 * _BRAKING * limits.acceleration * distance)
    share = min(limits.speed, stoppable, distance / dt) / distance if distance > 0.0 else 0.0
    wanted = ((a - x) * share, (b - y) * share, (c - z) * share)
    most, size = limits.acceleration * dt, math.dist(wanted, velocity)
    p, q, r = wanted
    if size > most:
        part = most / size
        p, q, r = u + (p - u) * part, v + (q - v) * part, w + (r - w) * part
    return (x + p * dt, y + q * dt, z + r * dt), (p, q, r)
