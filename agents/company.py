"""Who else may be in the air: whom a drone hears, whom it misses, whom it knows down. Pure: time is passed in.

Two drones keep apart only while one of them knows where the other is. So:

* A body is remembered for as long as the ladder, or what its vehicle does without commands, can keep it up, or
  until it is heard on the ground (`Memory`).
* Everybody says whom it does not hear (`unheard`), and where it saw them last (`lost`). Who finds itself among
  the unheard, hears nobody at all, or does not hear one whom others hear, is *missed*: it holds, and lands
  before the others stop remembering it. Of two that lost only each other the one with the higher number is.
* Nobody takes off or follows before it has heard everybody, or has been told where they were seen last.
"""

from collections.abc import Collection, Iterable, Mapping
from typing import NamedTuple

from agents.control.modes import HAND_LAND, TOUCHDOWN
from shared.clock import NS_PER_S
from shared.messages import MOST_LOST, DroneState, Lost, Mode, Vector
from shared.senses import Sensed
from shared.topics import DRONE_STATE

UNHEARD_AFTER = DRONE_STATE.stale_s
"""A drone that has been silent for longer is not heard, s."""
SETTLING = 5.0
"""A landing takes longer than its way at the landing speed by at most this, s."""
FALL = 2.0
"""A body whose motors are cut is on the ground within this time, s."""

_UNHEARD_NS = round(UNHEARD_AFTER * NS_PER_S)


class Memory(NamedTuple):
    """How long the body of a drone that has fallen silent may stay in the air.

    Attributes:
        hovers: Without its agent it hovers for ever.
        takeoff_height: It may still climb to this, m.
        landing_speed: Of its landing at the end of the ladder, m/s.
    """

    hovers: bool
    takeoff_height: float
    landing_speed: float

    def lasts(self, mode: Mode, height: float) -> float:
        """Returns for how long it may be in the air, s from when it was heard last; 0: it is on the ground.

        Args:
            mode: What it said last.
            height: Where it was then, m.
        """
        if mode is Mode.GROUND:
            return 0.0
        if mode is Mode.STOP:
            return FALL if height > TOUCHDOWN else 0.0
        if self.hovers:
            return float("inf")
        return HAND_LAND + max(height, self.takeoff_height) / self.landing_speed + SETTLING


class Missing(NamedTuple):
    """One that is not heard and may be in the air.

    Attributes:
        position: Where it was seen last, m.
        velocity: How it moved then, m/s; at rest if somebody else saw it.
        age: How long ago, s.
    """

    position: Vector
    velocity: Vector
    age: float


class Company(NamedTuple):
    """What one drone knows of the others.

    Attributes:
        heard: The newest of everybody who is heard.
        missing: Who is not heard and may be in the air.
        unheard: Numbers of all who are not heard, for the others.
        lost: Where those were seen last, for the others.
        awaited: Those of them of whom nothing is known at all.
        deaf: Those whom this drone hears, and who do not hear it.
        missed: Whether it is not heard where it should be, and so must not count on being avoided.
        alone: Whether it hears nobody although there are others.
    """

    heard: list[Sensed[DroneState]]
    missing: list[Missing]
    unheard: tuple[int, ...]
    lost: tuple[Lost, ...]
    awaited: tuple[int, ...]
    deaf: frozenset[int]
    missed: bool
    alone: bool


def look_around(
    drone: int,
    memories: Mapping[int, Memory],
    known: Mapping[int, Sensed[DroneState]],
    doubted_ns: Mapping[int, int],
    now_ns: int,
) -> Company:
    """Sorts the others by what is known of them.

    Args:
        drone: Own number.
        memories: One per drone that may fly beside this one.
        known: The newest state of each that was ever heard.
        doubted_ns: When something that was not believed last came from them (own clock, ns).
        now_ns: Own clock.
    """
    heard: list[Sensed[DroneState]] = []
    silent: list[int] = []
    for other in memories:
        sensed = known.get(other)
        if sensed is not None and now_ns - sensed.arrival_ns <= _UNHEARD_NS:
            heard.append(sensed)
        else:
            silent.append(other)
    reports = [sensed.message for sensed in heard if sensed.message.unheard]
    deaf = frozenset(report.id for report in reports if drone in report.unheard) if reports else frozenset()
    if not silent:
        return Company(heard, [], (), (), (), deaf, missed=bool(deaf), alone=False)
    lost: list[Lost] = []
    velocities: dict[int, Vector] = {}
    awaited = []
    for other in silent:
        sensed = known.get(other)
        seen = _own(sensed, memories[other], doubted_ns.get(other), now_ns) if sensed else _told(other, reports)
        if seen is None:
            awaited.append(other)
            continue
        lost.append(seen)
        if sensed is not None:
            velocities[other] = sensed.message.velocity
    flying = [seen for seen in lost if not seen.down]
    alone = not heard
    broken = any(seen.id < drone and _is_heard_elsewhere(seen.id, heard) for seen in flying)
    return Company(
        heard=heard,
        missing=[Missing(seen.position, velocities.get(seen.id, _AT_REST), seen.age) for seen in flying],
        unheard=tuple(silent),
        lost=tuple(sorted(lost, key=lambda seen: (seen.down, seen.age))[:MOST_LOST]),
        awaited=tuple(awaited),
        deaf=deaf,
        missed=bool(deaf) or broken or (alone and (bool(flying) or bool(awaited))),
        alone=alone,
    )


_AT_REST: Vector = (0.0, 0.0, 0.0)


def _own(sensed: Sensed[DroneState], memory: Memory, doubted_ns: int | None, now_ns: int) -> Lost:
    """Returns where this drone itself saw one that it no longer hears."""
    state = sensed.message
    # Somebody still speaks for it, be it what cannot be believed: so long it may be anywhere but forgotten.
    last_ns = max(sensed.arrival_ns, doubted_ns or 0)
    down = (now_ns - last_ns) / NS_PER_S > memory.lasts(state.mode, state.position[2])
    return Lost(state.id, state.epoch, state.seq, state.position, sensed.age(now_ns), down)


def _told(other: int, reports: Iterable[DroneState]) -> Lost | None:
    """Returns where others saw one last whom this drone never heard; who doubts that it is down is right."""
    seen = [lost for report in reports for lost in report.lost if lost.id == other]
    return max(seen, key=lambda lost: (lost.epoch, lost.seq, not lost.down), default=None)


def _is_heard_elsewhere(other: int, heard: Collection[Sensed[DroneState]]) -> bool:
    return any(other not in sensed.message.unheard for sensed in heard)
