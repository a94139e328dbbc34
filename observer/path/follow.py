"""Follows one hand sample through a recorded flight by the `heard` entries of its messages. Pure.

Samples are not all used and listeners fan in, so what is followed is not one message but the *first effect*:
the first state of a drone that contains the sample, or a newer one, through every hop of the reference path. A
hop leads from the sender's first message that carries the sample to that of the listener.
"""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from statistics import median
from typing import NamedTuple

from attrs import evolve

from observer.path.flight import RecordedFlight
from observer.path.hop import GLOVE_NODE, HAND_NODE, Cause, Effect, HandPath, Hop, Part, drone_node
from observer.through import HAND_KEY
from shared.clock import NS_PER_S
from shared.messages import DroneState, HandSample, Heard, Message, PatternEvent
from shared.topics import DRONE_STATE

GLOVE_WINDOW_NS = NS_PER_S
"""A pattern that starts later than this after a sample is no effect of it."""

STALL_NS = 50_000_000
"""An agent steps at least every 25 ms; one that rests twice as long was stopped or starved."""

_MOST_SAMPLES = 200


class Excess(NamedTuple):
    """By how much a part of a hop took longer than its median in the flight, ns."""

    hop: Hop
    part: Part
    excess_ns: float


Typical = dict[tuple[str, str, Part], float]
"""(sender, listener, part) -> median, ns."""


class _Step(NamedTuple):
    """A listener's step: when it started and was done, and the states of the listener before it."""

    node: str
    start_ns: int
    done_ns: int
    before: Sequence[DroneState] = ()


def follow(flight: RecordedFlight, number: int) -> HandPath:
    """Follows one sample.

    Args:
        flight: The flight.
        number: Of the sample.

    Raises:
        ConfigError: It was not recorded.
    """
    sample = flight.sample(number)
    found = [*(_drone_effect(flight, drone, number, sample) for drone in flight.order())]
    found.append(_glove_effect(flight, number, sample))
    return HandPath(
        number=number, sample=sample, effects={effect.node: effect for effect in found if effect is not None}
    )


def typical(flight: RecordedFlight) -> Typical:
    """Returns how long the parts of each hop take in this flight, over many samples."""
    numbers = sorted(flight.hands)
    chosen = numbers[:: 1 + len(numbers) // _MOST_SAMPLES]
    times: dict[tuple[str, str, Part], list[int]] = {}
    for number in chosen:
        for effect in _drone_effects(follow(flight, number)):
            for hop, part, took_ns in _shares(effect):
                times.setdefault((hop.sender, hop.listener, part), []).append(took_ns)
    return {key: median(values) for key, values in times.items()}


def most_unusual(path: HandPath, usual: Typical) -> Excess | None:
    """Returns what took longest beyond its median, None if nothing came through.

    Only what held a drone up counts: the input that decided, and those that arrived still later.
    """
    candidates = (
        Excess(hop, part, took_ns - usual.get((hop.sender, hop.listener, part), 0.0))
        for effect in _drone_effects(path)
        for hop, part, took_ns in _shares(effect)
        if hop.arrival_ns >= effect.inputs[0].arrival_ns and hop.cause is not Cause.EARLIER
    )
    return max(candidates, key=lambda candidate: candidate.excess_ns, default=None)


def _drone_effects(path: HandPath) -> Iterator[Effect]:
    return (effect for effect in path.effects.values() if effect.inputs and effect.node != GLOVE_NODE)


def _shares(effect: Effect) -> Iterator[tuple[Hop, Part, int]]:
    """Yields the parts of all hops into a node; waiting for another input is that one's, not a part."""
    complete_ns = max(hop.arrival_ns for hop in effect.inputs)
    for hop in effect.inputs:
        for part, took_ns in hop.parts_ns.items():
            yield hop, part, hop.start_ns - complete_ns if part is Part.WAITING else took_ns


def _drone_effect(flight: RecordedFlight, drone: int, number: int, sample: HandSample) -> Effect | None:
    flown = flight.drones[drone]
    row, direct = flown.first_through(number), flown.first_direct(number)
    if row is None or direct is None:
        return None
    state = flown.states[row]
    step = _Step(drone_node(drone), state.step_ns, state.stamp_ns, flown.states[:row])
    hops = {
        drone_node(other): _drone_hop(flight, other, number, state.heard.get(DRONE_STATE.key(id=other)), step)
        for other in flight.formation.references(drone)
    }
    hand = _hand_hop(flight, number, sample, state.heard.get(HAND_KEY), step)
    if hand and not flight.formation.refers_to_human(drone):
        cause = Cause.EARLIER if hand.skipped and direct < row else hand.cause
        hand = evolve(hand, on_path=False, cause=cause)
    hops[HAND_NODE] = hand
    return Effect(
        node=step.node,
        done_ns=state.stamp_ns,
        seq=state.seq,
        number=flown.through[row],
        directly_ns=flown.states[direct].stamp_ns,
        inputs=_deciding_first(hops.values()),
        lacked=tuple(node for node, hop in hops.items() if hop is None),
    )


def _glove_effect(flight: RecordedFlight, number: int, sample: HandSample) -> Effect | None:
    """Returns the first pattern that started from a state that contains the sample, if one soon did."""
    for event in flight.started:
        if 0 <= event.started_ns - sample.stamp_ns <= GLOVE_WINDOW_NS:
            hops = _deciding_first(_glove_hops(flight, event, number))
            if hops:
                return Effect(
                    node=GLOVE_NODE,
                    done_ns=event.started_ns,
                    seq=event.seq,
                    number=number,
                    directly_ns=event.started_ns,
                    inputs=hops,
                    pattern=event.pattern,
                )
    return None


def _glove_hops(flight: RecordedFlight, event: PatternEvent, number: int) -> Iterator[Hop | None]:
    """Yields a hop for every drone whose state brought the pattern about; the step is the bridge's."""
    cause = flight.formation_states.get((event.epoch, event.state_seq))
    step = _Step(GLOVE_NODE, cause.stamp_ns if cause else event.started_ns, event.started_ns)
    for drone in flight.formation.ids:
        hop = _drone_hop(flight, drone, number, event.heard.get(DRONE_STATE.key(id=drone)), step)
        yield hop and evolve(hop, cause=Cause.PATTERN if hop.skipped else Cause.NONE)


def _hand_hop(
    flight: RecordedFlight, number: int, sample: HandSample, heard: Heard | None, step: _Step
) -> Hop | None:
    used = flight.number(heard) if heard else None
    if heard is None or used is None or used < number or used not in flight.hands:
        return None
    hop = _hop(HAND_NODE, sample, flight.hands[used], heard, step)
    return evolve(hop, skipped=used - number)


def _drone_hop(flight: RecordedFlight, drone: int, number: int, heard: Heard | None, step: _Step) -> Hop | None:
    flown = flight.drones[drone]
    first, used = flown.first_through(number), flown.row(heard) if heard else None
    if heard is None or first is None or used is None or flown.through[used] < number:
        return None
    hop = _hop(drone_node(drone), flown.states[first], flown.states[used], heard, step)
    return evolve(hop, skipped=used - first)


def _hop(sender: str, first: Message, used: Message, heard: Heard, step: _Step) -> Hop:
    return Hop(
        sender=sender,
        listener=step.node,
        sent_ns=first.stamp_ns,
        used_ns=used.stamp_ns,
        arrival_ns=heard.arrival_ns,
        start_ns=step.start_ns,
        done_ns=step.done_ns,
        cause=_cause(first, used, heard, step),
    )


def _cause(first: Message, used: Message, heard: Heard, step: _Step) -> Cause:
    """Says why not the first message was used.

    A listener that steps as usual without it has not got it in time. One that does not step until it uses a
    newer one was busy; and one that stood still when the first should have arrived may well step once, on
    what it knew before, as soon as it runs again.
    """
    if (first.epoch, first.seq) == (used.epoch, used.seq):
        return Cause.NONE
    expected_ns = first.stamp_ns + heard.arrival_ns - used.stamp_ns
    row = bisect_right(step.before, expected_ns, key=lambda state: state.step_ns)
    if row == len(step.before):
        return Cause.LISTENER
    gap_ns = step.before[row].step_ns - step.before[row - 1].step_ns if row else 0
    return Cause.LISTENER if gap_ns > STALL_NS else Cause.LINK


def _deciding_first(hops: Iterable[Hop | None]) -> tuple[Hop, ...]:
    """Puts first, among the hops on the path, the one that arrived last."""
    found = [hop for hop in hops if hop is not None]
    return tuple(sorted(found, key=lambda hop: (hop.on_path, hop.arrival_ns), reverse=True))
