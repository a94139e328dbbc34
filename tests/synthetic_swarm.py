"""Messages of a rhombus as real agents would send them, with delays, losses and stalls put in on purpose."""

from collections.abc import Callable
from typing import NamedTuple

from shared.config import load_scenario
from shared.formation import build_formation
from shared.messages import (
    ORIGIN,
    DroneState,
    FormationState,
    HandSample,
    Heard,
    Message,
    Mode,
    PatternEvent,
    Wish,
)

MS = 1_000_000
T0 = 1_000_000 * MS
TICK = 16 * MS
FALLBACK = 25 * MS
RHOMBUS = build_formation(load_scenario("rhombus"))
HAND = "hand"

Delay = Callable[[str, int, int], int | None]
"""(sender, listener, seq) -> time on the link, ns; None: lost."""
Compute = Callable[[int, int], int]
"""(drone, tick of the newest hand sample) -> length of the step, ns."""


class _Arrival(NamedTuple):
    at_ns: int
    key: str
    seq: int


def usual_delay(_sender: str, _listener: int, _seq: int) -> int | None:
    return MS // 2


def usual_compute(_drone: int, _tick: int) -> int:
    return MS


def fly(ticks: int, delay: Delay = usual_delay, compute: Compute = usual_compute) -> list[Message]:
    """Everything that hand and drones say in so many ticks."""
    hands = [hand(tick) for tick in range(ticks)]
    states: dict[int, list[DroneState]] = {}
    for drone in (RHOMBUS.ids[row] for level in RHOMBUS.levels for row in level):
        sent: list[tuple[str, str, Message]] = [(HAND, "human/hand", sample) for sample in hands]
        for other in RHOMBUS.references(drone):
            sent += [(f"drone {other}", f"drone/{other}/state", state) for state in states[other]]
        arrivals = [
            _Arrival(message.stamp_ns + took, key, message.seq)
            for sender, key, message in sent
            if (took := delay(sender, drone, message.seq)) is not None
        ]
        states[drone] = _steps(drone, sorted(arrivals), compute) if arrivals else []
    return [*hands, *(state for drone in states for state in states[drone])]


def hand(seq: int) -> HandSample:
    return HandSample(
        epoch=1,
        seq=seq,
        stamp_ns=T0 + seq * TICK,
        position=ORIGIN,
        velocity=ORIGIN,
        yaw=0.0,
        mode=Wish.FLY,
    )


def pattern(name: str, cause: DroneState, started_ns: int, arrival_ns: int) -> list[Message]:
    """What the bridge says when the state of a drone has brought a pattern about."""
    heard = {f"drone/{cause.id}/state": Heard(cause.epoch, cause.seq, arrival_ns)}
    stamp_ns = (started_ns + arrival_ns) // 2
    formation = FormationState(
        epoch=1,
        seq=7,
        stamp_ns=stamp_ns,
        area=1.0,
        area_ratio=1.0,
        distances={},
        extent=0,
        trend=0,
        displacement=0.0,
        heard=heard,
    )
    event = PatternEvent(
        epoch=1,
        seq=0,
        stamp_ns=started_ns,
        pattern=name,
        outcome="started",
        state_seq=7,
        heard=heard,
        started_ns=started_ns,
    )
    return [formation, event]


def _steps(drone: int, arrivals: list[_Arrival], compute: Compute) -> list[DroneState]:
    """Steps when every input is new, else 25 ms after the last step; what arrives meanwhile waits."""
    inputs = {arrival.key for arrival in arrivals}
    newest: dict[str, _Arrival] = {}
    used: dict[str, _Arrival] = {}
    states: list[DroneState] = []
    begun_ns = free_ns = arrivals[0].at_ns
    pending = list(reversed(arrivals))
    while pending:
        due_ns = max(free_ns, begun_ns + FALLBACK) if states else pending[0].at_ns + FALLBACK
        complete = all(newest.get(key) != used.get(key) for key in inputs)
        start_ns = max(free_ns, *(arrival.at_ns for arrival in newest.values())) if complete else due_ns
        if pending[-1].at_ns <= start_ns:
            arrival = pending.pop()
            if arrival.key not in newest or arrival.seq > newest[arrival.key].seq:
                newest[arrival.key] = arrival
            continue
        tick = newest["human/hand"].seq if "human/hand" in newest else 0
        begun_ns, free_ns = start_ns, start_ns + compute(drone, tick)
        used = dict(newest)
        heard = {key: Heard(1, arrival.seq, arrival.at_ns) for key, arrival in newest.items()}
        states.append(_state(drone, len(states), begun_ns, free_ns, heard))
    return states


def _state(drone: int, seq: int, step_ns: int, stamp_ns: int, heard: dict[str, Heard]) -> DroneState:
    return DroneState(
        epoch=1,
        seq=seq,
        stamp_ns=stamp_ns,
        step_ns=step_ns,
        id=drone,
        position=ORIGIN,
        velocity=ORIGIN,
        goal=ORIGIN,
        goal_velocity=ORIGIN,
        setpoint=ORIGIN,
        mode=Mode.FOLLOW,
        heard=heard,
    )
