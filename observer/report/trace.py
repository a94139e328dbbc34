"""Our own traces as flight records: messages of many clocks and rates on one axis of 60 Hz.

A record covers the time in which every drone was in FOLLOW or HOLD, from the first such moment to the last.
Values between two messages are interpolated, but not across a gap in which somebody was silent.
"""

import contextlib
from collections.abc import Callable, Iterable, Sequence
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from observer.report.record import ROW_HZ, FlightRecord, Played, mapped_hand, resample
from observer.trace.order import Record
from observer.trace.read import Trace
from shared.clock import NS_PER_S
from shared.cylinders import columns_of
from shared.errors import ConfigError
from shared.formation import Formation, build_formation
from shared.geometry import hull_area
from shared.messages import (
    MAX_POSITION,
    NO_HAND,
    DroneState,
    HandSample,
    Message,
    Mode,
    ObstacleState,
    PatternEvent,
)
from shared.obstacle_watch import MOST_OBSTACLES
from shared.plain_text import plain
from shared.recordings.check import check
from shared.recordings.track import Found, Vec
from shared.scenario import Scenario

FORMED = (Mode.FOLLOW, Mode.HOLD)
_LATEST_NS = 2**63 - 1
_LONGEST_NAME = 40

M = TypeVar("M", HandSample, DroneState, ObstacleState)


class _Said(Generic[M]):
    """What somebody said, as it came.

    Args:
        stamp: When a message was true, by its sender, ns.
    """

    def __init__(self, stamp: Callable[[M], int]) -> None:
        self.messages: list[M] = []
        self._stamp: Callable[[M], int] = stamp
        self._times: list[tuple[int, int]] = []

    def add(self, record: Record, message: M) -> None:
        """Takes the next message."""
        self.messages.append(message)
        self._times.append((min(self._stamp(message), _LATEST_NS), min(record.log_ns, _LATEST_NS)))

    def checked(self, name: str) -> "_Known[M]":
        """Leaves out what came out of time.

        Raises:
            ConfigError: Too little is left.
        """
        times = np.array(self._times, dtype=np.int64).reshape(-1, 2)
        position = np.array([message.position for message in self.messages]).reshape(-1, 3)
        found = Found(t_ns=times[:, 0], position=position, arrival_ns=times[:, 1])
        track, rows, _, report = check(found, name, room=MAX_POSITION)
        kept = [self.messages[row] for row in rows.tolist()]
        return _Known(track.t_ns.tolist(), kept, report.remarks)


class _Known(NamedTuple, Generic[M]):
    """What somebody said, in the order of its time."""

    t_ns: list[int]
    messages: list[M]
    remarks: tuple[str, ...]

    def at(self, t: Vec, start_ns: int, values: Callable[[M], Sequence[float]]) -> Vec:
        """Returns values of the messages at each wanted time since the start, s."""
        return resample(t, _seconds(self.t_ns, start_ns), np.array([values(each) for each in self.messages]))


class _Heard(NamedTuple):
    """The messages of a flight, by kind."""

    hand: _Said[HandSample]
    drones: dict[int, _Said[DroneState]]
    events: list[PatternEvent]
    walkers: dict[int, _Said[ObstacleState]]


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
    heard = _sort(formation, trace.all_messages())
    _check_flown(heard, name)
    human = heard.hand.checked(f"{name}, hand")
    drones = {number: said.checked(f"{name}, drone {number}") for number, said in heard.drones.items()}
    start_ns, end_ns = _formed_span(drones, name)
    t = np.arange(0.0, (end_ns - start_ns) / NS_PER_S, 1.0 / ROW_HZ)
    hand = human.at(t, start_ns, lambda sample: sample.position)

    def bodies(values: Callable[[DroneState], Sequence[float]]) -> Vec:
        return np.stack([drones[drone].at(t, start_ns, values) for drone in formation.ids], axis=1)

    return FlightRecord(
        name=name,
        source="trace",
        formation=formation,
        t=t,
        recorded_t=t,
        hand=hand,
        hand_velocity=human.at(t, start_ns, lambda sample: sample.velocity),
        mapped=mapped_hand(hand, scenario.hand),
        position=bodies(lambda state: state.position),
        goal=bodies(lambda state: state.goal),
        setpoint=bodies(lambda state: state.setpoint),
        displacement=_displacements(formation, drones, t, start_ns),
        default_area=hull_area((x, y) for x, y, _ in formation.rest),
        obstacles=scenario.obstacles,
        zones=_zones(scenario),
        walkers=_ways(heard, name, t, start_ns),
        patterns=_played(heard.events, start_ns, end_ns),
        remarks=(
            *trace.faults,
            *(f"hand: {remark}" for remark in human.remarks),
            *(f"drone {number}: {remark}" for number, known in drones.items() for remark in known.remarks),
        ),
    )


def _sort(formation: Formation, messages: Iterable[tuple[Record, Message]]) -> _Heard:
    heard = _Heard(
        _Said(lambda sample: sample.stamp_ns),
        {drone: _Said(lambda state: state.step_ns) for drone in formation.ids},
        [],
        {},
    )
    for record, message in messages:
        if isinstance(message, HandSample) and message.position != NO_HAND:
            heard.hand.add(record, message)
        elif isinstance(message, DroneState) and message.id in heard.drones:
            heard.drones[message.id].add(record, message)
        elif isinstance(message, PatternEvent):
            heard.events.append(message)
        elif isinstance(message, ObstacleState) and len(heard.walkers) < MOST_OBSTACLES:
            heard.walkers.setdefault(message.id, _Said(_stamp)).add(record, message)
    return heard


def _stamp(state: ObstacleState) -> int:
    return state.stamp_ns


def _ways(heard: _Heard, name: str, t: Vec, start_ns: int) -> dict[int, Vec]:
    """Returns the ways of what moved among the drones; of what was hardly heard there is none."""
    found = {}
    for number, said in sorted(heard.walkers.items()):
        with contextlib.suppress(ConfigError):
            known = said.checked(f"{name}, obstacle {number}")
            found[number] = known.at(t, start_ns, lambda state: state.position)
    return found


def _check_flown(heard: _Heard, name: str) -> None:
    """Raises `ConfigError` if some drone never was in the formation, or there was no hand."""
    formed = (any(state.mode in FORMED for state in said.messages) for said in heard.drones.values())
    if not heard.hand.messages or not all(formed):
        raise ConfigError(f"{name}: the whole formation never flew behind a hand; there is nothing to report")


def _formed_span(drones: dict[int, _Known[DroneState]], name: str) -> tuple[int, int]:
    """Returns the first and the last moment at which all drones were in the formation, ns.

    Raises:
        ConfigError: There is none.
    """
    formed = [
        [t_ns for t_ns, state in zip(known.t_ns, known.messages, strict=True) if state.mode in FORMED]
        for known in drones.values()
    ]
    if all(formed):
        start_ns, end_ns = max(stamps[0] for stamps in formed), min(stamps[-1] for stamps in formed)
        if start_ns < end_ns:
            return start_ns, end_ns
    raise ConfigError(f"{name}: the drones never flew all at once; there is nothing to report")


def _seconds(stamps_ns: Sequence[int], start_ns: int) -> Vec:
    return (np.array(stamps_ns, dtype=np.int64) - start_ns) / NS_PER_S


def _displacements(
    formation: Formation, drones: dict[int, _Known[DroneState]], t: Vec, start_ns: int
) -> dict[str, Vec]:
    """Returns the displacement of every link that is switched on; each is told by the drone at its end."""
    found = {}
    for link in formation.links:
        known = drones[formation.ids[link.target]]
        said = [
            (t_ns, state.displacements[link.name])
            for t_ns, state in zip(known.t_ns, known.messages, strict=True)
            if link.name in state.displacements
        ]
        if link.gain and said:
            at = _seconds([t_ns for t_ns, _ in said], start_ns)
            found[link.name] = resample(t, at, np.array([displacement for _, displacement in said]))
    return found


def _zones(scenario: Scenario) -> tuple[float, ...]:
    avoidance = scenario.avoidance
    if avoidance.rule == "projection":
        return (avoidance.projection_radius + avoidance.projection_margin,) * len(scenario.obstacles)
    return tuple(column.radius + avoidance.columns.d0 for column in columns_of(scenario))


def _played(events: Sequence[PatternEvent], start_ns: int, end_ns: int) -> tuple[Played, ...]:
    """Returns the patterns that began in this time, each with the time until it ended or was cut short."""
    ended = [
        event
        for event in events
        if start_ns <= event.started_ns <= end_ns and event.outcome in ("finished", "failed")
    ]
    return tuple(
        Played(
            (event.started_ns - start_ns) / NS_PER_S,
            plain(event.pattern, _LONGEST_NAME),
            max(0.0, ((event.finished_ns or event.stamp_ns) - event.started_ns) / NS_PER_S),
        )
        for event in sorted(ended, key=lambda event: event.started_ns)
    )
