"""Who else may be in the air: whom a drone hears, whom it misses, whom it knows down. Pure: time is passed in.

Two drones keep apart only while one of them knows where the other is. So:

* A body is remembered for as long as the ladder, or what its vehicle does without commands, can keep it up, or
  until it is heard on the ground (`Memory`).
* Everybody says whom it does not hear (`unheard`), and where it saw them last (`lost`). Who finds itself among
  the unheard, hears nobody at all, or does not hear one whom others hear, is *missed*: it holds, and lands
  before the others stop remembering it. Of two that lost only each other the one with the higher number is.
* Nobody takes off or follows before it has heard everybody, or has been told where they were seen last.
"""

from collections.abc import Callable
from typing import Final, NamedTuple, final

from agents.control.modes import GROUND, HAND_LAND, STOP, TOUCHDOWN
from shared.clock import NS_PER_S
from shared.messages import MOST_LOST, DroneState, Mode, Seen
from shared.senses import Sensed
from shared.topics import DRONE_STATE

UNHEARD_AFTER: Final = DRONE_STATE.stale_s
"""A drone that has been silent for longer is not heard, s."""
TOLD_WITHIN: Final = 2.0
"""The word of somebody who is heard goes round within this time, s."""
SETTLING: Final = 5.0
"""A landing takes longer than its way at the landing speed by at most this, s."""
FALL: Final = 2.0
"""A body whose motors are cut is on the ground within this time, s."""

_UNHEARD_NS: Final = round(UNHEARD_AFTER * NS_PER_S)


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
        if mode is GROUND:
            return 0.0
        if mode is STOP:
            return FALL if height > TOUCHDOWN else 0.0
        if self.hovers:
            return float("inf")
        return HAND_LAND + max(height, self.takeoff_height) / self.landing_speed + SETTLING


@final
class Company:
    """What one drone knows of the others.

    Attributes:
        heard: The newest of everybody who is heard.
        missing: Who is not heard and may be in the air, as it was seen last.
        unheard: Numbers of all who are not heard, for the others.
        lost: As what those were seen last, for the others.
        awaited: Those of them of whom nothing is known at all.
        deaf: Those whom this drone hears, and who do not hear it.
        missed: Whether it is not heard where it should be, and so must not count on being avoided.
        alone: Whether it hears nobody although there are others.
    """

    def __init__(
        self,
        heard: list[Sensed[DroneState]],
        missing: list[Seen],
        unheard: tuple[int, ...],
        lost: tuple[Seen, ...],
        awaited: tuple[int, ...],
        deaf: frozenset[int],
        *,
        missed: bool,
        alone: bool,
    ) -> None:
        self.heard: Final = heard
        self.missing: Final = missing
        self.unheard: Final = unheard
        self.lost: Final = lost
        self.awaited: Final = awaited
        self.deaf: Final = deaf
        self.missed: Final = missed
        self.alone: Final = alone


_NOBODY: Final[frozenset[int]] = frozenset()


def look_around(
    drone: int,
    memories: dict[int, Memory],
    known: dict[int, Sensed[DroneState]],
    doubted_ns: dict[int, int],
    now_ns: int,
    elsewhere: Callable[[int], Seen | None] | None = None,
) -> Company:
    """Sorts the others by what is known of them.

    Args:
        drone: Own number.
        memories: One per drone that may fly beside this one.
        known: The newest state of each that was ever heard.
        doubted_ns: When something that was not believed last came from them (own clock, ns).
        now_ns: Own clock.
        elsewhere: Returns as what others say that they saw one, where not everybody hears everybody.
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
    deaf = frozenset(report.id for report in reports if drone in report.unheard) if reports else _NOBODY
    if not silent:
        return Company(heard, [], (), (), (), deaf, missed=bool(deaf), alone=False)
    told = {} if elsewhere is None else {other: elsewhere(other) for other in silent}
    seen = _seen(silent, known, reports, told, now_ns)
    missing = [each for each in seen if may_fly(each, memories[each.id], doubted_ns.get(each.id), now_ns)]
    awaited = tuple(set(silent) - {each.id for each in seen})
    cut_off = not heard and bool(missing or awaited)
    lower = [each.id for each in missing if each.id < drone]
    if elsewhere is None:
        broken = any(_is_heard_elsewhere(other, heard) for other in lower)
    else:
        broken = any(_is_seen_elsewhere(known.get(other), told.get(other), now_ns) for other in lower)
    return Company(
        heard,
        missing,
        tuple(silent),
        tuple(sorted(seen, key=lambda each: (each not in missing, each.age))[:MOST_LOST]),
        tuple(sorted(awaited)),
        deaf,
        missed=bool(deaf) or broken or cut_off,
        alone=not heard,
    )


def _seen(
    silent: list[int],
    known: dict[int, Sensed[DroneState]],
    reports: list[DroneState],
    told: dict[int, Seen | None],
    now_ns: int,
) -> list[Seen]:
    """Returns as what the silent ones were seen last: by this drone itself, or else by others."""
    found = []
    for other in silent:
        sensed, word = known.get(other), told.get(other)
        seen = _told(other, reports) if sensed is None else seen_of(sensed, sensed.age(now_ns))
        if word is not None and (seen is None or _order(word) > _order(seen)):
            seen = word
        if seen is not None:
            found.append(seen)
    return found


def _order(seen: Seen) -> tuple[int, int]:
    return (seen.epoch, seen.seq)


def seen_of(sensed: Sensed[DroneState], age: float) -> Seen:
    """Returns as what one that was heard was seen.

    Args:
        sensed: What it said.
        age: How long ago that was, s.
    """
    state = sensed.message
    return Seen(state.id, state.epoch, state.seq, state.position, state.velocity, state.mode, age)


def _told(other: int, reports: list[DroneState]) -> Seen | None:
    seen = [each for report in reports for each in report.lost if each.id == other]
    return max(seen, key=lambda each: (each.epoch, each.seq, -each.age), default=None)


def may_fly(seen: Seen, memory: Memory, doubted_ns: int | None, now_ns: int) -> bool:
    """Says whether one that is not heard may be in the air.

    Args:
        seen: As what it was seen last.
        memory: How long its body may stay there.
        doubted_ns: When something that was not believed last came from it (own clock, ns).
        now_ns: Own clock.
    """
    # While somebody speaks for it, be it what cannot be believed, it may be anywhere but forgotten.
    age = seen.age if doubted_ns is None else min(seen.age, (now_ns - doubted_ns) / NS_PER_S)
    return age < memory.lasts(seen.mode, seen.position[2])


def _is_heard_elsewhere(other: int, heard: list[Sensed[DroneState]]) -> bool:
    """Says whether one that is silent is heard by somebody else, where everybody listens to everybody."""
    return any(other not in sensed.message.unheard for sensed in heard)


def _is_seen_elsewhere(own: Sensed[DroneState] | None, told: Seen | None, now_ns: int) -> bool:
    """The same where not everybody does: somebody has seen it since this drone heard it last."""
    if told is None or told.age > TOLD_WITHIN:
        return False
    return own is None or told.age < own.age(now_ns) - UNHEARD_AFTER
