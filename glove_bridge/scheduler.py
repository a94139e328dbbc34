"""What plays when: one pattern at a time, the newest state, a gate between patterns, safety cues first. Pure.

A pattern is never cut short (only STOP does that, and then nothing is scheduled). While one plays or the gate
is closed, wishes are not queued: when the glove is free again, whatever the state calls for then is played.
What was wished for meanwhile and is not played is reported as suppressed, once per pattern.

A safety cue does not wait for the gate, only for the pattern that plays. It plays when its condition begins and
again every `REMIND_NS` while it holds; one that was not felt plays as soon as it can be. A condition that is
gone for `CLEAR_NS` begins anew; one that flickers faster plays no more often than one that lasts.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from attrs import evolve, field, frozen

from glove_bridge.cues import Cue
from glove_bridge.patterns.pattern import Pattern
from shared.clock import NS_PER_S
from shared.messages import Heard

REMIND_NS = 5 * NS_PER_S
RETRY_NS = CLEAR_NS = NS_PER_S
_NS_PER_MS = 1_000_000


@frozen(kw_only=True)
class Request:
    """A pattern that a state calls for.

    Attributes:
        pattern: The pattern.
        state_seq: Number of that `FormationState`.
        heard: The samples that brought it about.
    """

    pattern: Pattern
    state_seq: int
    heard: Mapping[str, Heard] = field(factory=dict, hash=False)


class Reminder(NamedTuple):
    """What is known of a cue that has played: when it did, when its condition held last, and if it was felt."""

    played_ns: int
    held_ns: int
    felt: bool = True


@frozen(kw_only=True)
class Schedule:
    """The state of the scheduler.

    Attributes:
        playing: What is on the glove, None if it is free.
        cue: The cue that this is, None for a state of the formation.
        gate_ns: When the gate opens.
        silent_ns: How long a state without a side closes the gate: as long as the last pattern did.
        told: What plays, or closed the gate: wishing for it meanwhile is no news.
        missed: Other patterns wished for meanwhile, by name.
        reminders: Cues that have played and whose conditions are not over.
    """

    playing: Request | None = None
    cue: Cue | None = None
    gate_ns: int = 0
    silent_ns: int = 0
    told: str | None = None
    missed: Mapping[str, Request] = field(factory=dict)
    reminders: Mapping[Cue, Reminder] = field(factory=dict)


@frozen(kw_only=True)
class Decision:
    """What one call decided.

    Attributes:
        play: To be played now, None if nothing is.
        suppressed: Wishes that are not played.
    """

    play: Request | None = None
    suppressed: tuple[Request, ...] = ()


def decide(
    schedule: Schedule,
    wish: Request | None,
    cues: Sequence[tuple[Cue, Request]],
    now_ns: int,
    *,
    silent: bool = False,
    connected: bool = True,
) -> tuple[Schedule, Decision]:
    """Decides what to play.

    Args:
        schedule: The scheduler.
        wish: What the newest state of the formation calls for.
        cues: The conditions that hold, the most urgent first, with their patterns.
        now_ns: The time.
        silent: The state would have a pattern if it had a side; it restarts an open gate (`flight-2018`).
        connected: Whether patterns can be felt.

    Returns:
        The scheduler, with what is to be played as playing, and the decision.
    """
    schedule = evolve(schedule, reminders=_lasting(schedule.reminders, [cue for cue, _ in cues], now_ns))
    if schedule.playing:
        return _miss(schedule, wish), Decision()
    for cue, request in cues:
        last = schedule.reminders.get(cue)
        rest_ns = RETRY_NS if last and not last.felt and connected else REMIND_NS
        if last is None or now_ns >= last.played_ns + rest_ns:
            reminders = {**schedule.reminders, cue: Reminder(now_ns, now_ns)}
            schedule = evolve(_miss(schedule, wish), told=None, reminders=reminders)
            return _play(schedule, request, now_ns, cue), Decision(play=request)
    if now_ns < schedule.gate_ns:
        return _miss(schedule, wish), Decision()
    told = wish.pattern.name if wish else None
    suppressed = tuple(request for name, request in schedule.missed.items() if name != told)
    schedule = evolve(schedule, told=told, missed={})
    if wish:
        schedule = _play(schedule, wish, now_ns)
        return evolve(schedule, silent_ns=_gate_ns(wish)), Decision(play=wish, suppressed=suppressed)
    if silent:
        schedule = evolve(schedule, gate_ns=now_ns + schedule.silent_ns)
    return schedule, Decision(suppressed=suppressed)


def started(schedule: Schedule, started_ns: int) -> Schedule:
    """Notes when the first frame of what plays has started: from there the gate counts."""
    if schedule.playing is None:
        return schedule
    return evolve(schedule, gate_ns=started_ns + _gate_ns(schedule.playing))


def ended(schedule: Schedule, *, felt: bool) -> Schedule:
    """Notes that the glove is free again, because the pattern has ended, or failed."""
    reminder = schedule.reminders.get(schedule.cue) if schedule.cue else None
    if schedule.cue and reminder and not felt:
        schedule = evolve(
            schedule, reminders={**schedule.reminders, schedule.cue: reminder._replace(felt=False)}
        )
    return evolve(schedule, playing=None, cue=None)


def _lasting(reminders: Mapping[Cue, Reminder], holding: Sequence[Cue], now_ns: int) -> dict[Cue, Reminder]:
    """Notes which conditions hold now, and forgets those that are over."""
    seen = {cue: last._replace(held_ns=now_ns) if cue in holding else last for cue, last in reminders.items()}
    return {cue: last for cue, last in seen.items() if now_ns - last.held_ns < CLEAR_NS}


def _play(schedule: Schedule, request: Request, now_ns: int, cue: Cue | None = None) -> Schedule:
    """Puts a pattern on the glove; the gate closes even if it never starts."""
    return evolve(schedule, playing=request, cue=cue, gate_ns=now_ns + _gate_ns(request))


def _gate_ns(request: Request) -> int:
    return request.pattern.gate_ms * _NS_PER_MS


def _miss(schedule: Schedule, wish: Request | None) -> Schedule:
    if wish is None or wish.pattern.name == schedule.told or wish.pattern.name in schedule.missed:
        return schedule
    return evolve(schedule, missed={**schedule.missed, wish.pattern.name: wish})
