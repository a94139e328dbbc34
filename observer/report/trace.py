"""Our own traces as flight records: messages of many clocks and rates on one axis of 60 Hz.

A record covers the time in which every drone was in FOLLOW or HOLD, from the first such moment to the last.
Values between two messages are interpolated, also across a gap in which a drone was silent.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from observer.report.record import ROW_HZ, FlightRecord, Played, mapped_hand, resample
from observer.trace.read import Trace
from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.formation import Formation, build_formation
from shared.geometry import hull_area
from shared.messages import NO_HAND, DroneState, HandSample, Message, Mode, PatternEvent
from shared.recordings.track import Vec
from shared.scenario import Avoidance

FORMED = (Mode.FOLLOW, Mode.HOLD)


class _Heard(NamedTuple):
    """The messages of a flight, by kind, in the order of their stamps."""

    hands: list[HandSample]
    states: dict[int, list[DroneState]]
    events: list[PatternEvent]


def read_trace(trace: Trace, name: str) -> FlightRecord:
    """Turns a trace into a flight record.

    Args:
        trace: The trace.
        name: What to call it.

    Raises:
        ConfigError: It holds no time in which the whole formation flew behind a hand.
    """
    scenario = trace.scenario
    formation = build_formation(scenario, name)
    heard = _sort(formation, (message for _, message in trace.messages()))
    start_ns, end_ns = _formed_span(heard, name)
    t = np.arange(0.0, (end_ns - start_ns) / NS_PER_S, 1.0 / ROW_HZ)
    hand_t = _seconds([hand.stamp_ns for hand in heard.hands], start_ns)
    hand = resample(t, hand_t, np.array([hand.position for hand in heard.hands]))

    def bodies(attribute: str) -> Vec:
        return np.stack(
            [_track(heard.states[drone], attribute, t, start_ns) for drone in formation.ids], axis=1
        )

    return FlightRecord(
        name=name,
        source="trace",
        formation=formation,
        t=t,
        recorded_t=t,
        hand=hand,
        hand_velocity=resample(t, hand_t, np.array([hand.velocity for hand in heard.hands])),
        mapped=mapped_hand(hand, scenario.hand),
        position=bodies("position"),
        goal=bodies("goal"),
        setpoint=bodies("setpoint"),
        displacement=_displacements(formation, heard.states, t, start_ns),
        default_area=hull_area((x, y) for x, y, _ in formation.rest),
        obstacles=scenario.obstacles,
        safety_radius=_safety_radius(scenario.avoidance),
        patterns=_played(heard.events, start_ns),
    )


def _sort(formation: Formation, messages: Iterable[Message]) -> _Heard:
    heard = _Heard([], {drone: [] for drone in formation.ids}, [])
    for message in messages:
        if isinstance(message, HandSample) and message.position != NO_HAND:
            heard.hands.append(message)
        elif isinstance(message, DroneState) and message.id in heard.states:
            heard.states[message.id].append(message)
        elif isinstance(message, PatternEvent):
            heard.events.append(message)
    heard.hands.sort(key=lambda hand: hand.stamp_ns)
    for states in heard.states.values():
        states.sort(key=lambda state: state.step_ns)
    return heard


def _formed_span(heard: _Heard, name: str) -> tuple[int, int]:
    """Returns the first and the last moment at which all drones were in the formation, ns.

    Raises:
        ConfigError: There is none, or no hand.
    """
    formed = [[s.step_ns for s in states if s.mode in FORMED] for states in heard.states.values()]
    if not heard.hands or not all(formed):
        raise ConfigError(f"{name}: the whole formation never flew behind a hand; there is nothing to report")
    start_ns, end_ns = max(stamps[0] for stamps in formed), min(stamps[-1] for stamps in formed)
    if start_ns >= end_ns:
        raise ConfigError(f"{name}: the drones never flew all at once; there is nothing to report")
    return start_ns, end_ns


def _seconds(stamps_ns: Sequence[int], start_ns: int) -> Vec:
    return (np.array(stamps_ns, dtype=np.int64) - start_ns) / NS_PER_S


def _track(states: Sequence[DroneState], attribute: str, t: Vec, start_ns: int) -> Vec:
    at = _seconds([state.step_ns for state in states], start_ns)
    return resample(t, at, np.array([getattr(state, attribute) for state in states]))


def _displacements(
    formation: Formation, states: dict[int, list[DroneState]], t: Vec, start_ns: int
) -> dict[str, Vec]:
    """Returns the displacement of every link that is switched on; each is told by the drone at its end."""
    found = {}
    for link in formation.links:
        told = [s for s in states[formation.ids[link.target]] if link.name in s.displacements]
        if link.gain and told:
            at = _seconds([state.step_ns for state in told], start_ns)
            found[link.name] = resample(t, at, np.array([state.displacements[link.name] for state in told]))
    return found


def _safety_radius(avoidance: Avoidance) -> float:
    if avoidance.rule == "projection":
        return avoidance.projection_radius + avoidance.projection_margin
    return avoidance.columns.radius + avoidance.columns.d0


def _played(events: Sequence[PatternEvent], start_ns: int) -> tuple[Played, ...]:
    """Returns the patterns that began, each with the time until it ended or was cut short."""
    ended = [event for event in events if event.started_ns and event.outcome in ("finished", "failed")]
    return tuple(
        Played(
            (event.started_ns - start_ns) / NS_PER_S,
            event.pattern,
            max(0.0, ((event.finished_ns or event.stamp_ns) - event.started_ns) / NS_PER_S),
        )
        for event in sorted(ended, key=lambda event: event.started_ns)
    )
