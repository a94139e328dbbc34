"""Traces made for tests."""

from pathlib import Path
from typing import Any

from observer.trace.write import TraceWriter
from shared.codec import encode
from shared.config import load_scenario
from shared.messages import DroneState, HandSample, Mode, Wish
from shared.scenario import Scenario
from shared.topics import DRONE_STATE, HAND
from shared.transport import Arrival

SCENARIO = load_scenario("rhombus")
START_NS = 1_700_000_000_000_000_000
STEP_NS = 1_000_000
ZERO = (0.0, 0.0, 0.0)

Payloads = list[tuple[str, bytes]]


def hand(seq: int, **fields: Any) -> HandSample:
    """Makes a hand sample of epoch 7."""
    content = {
        "epoch": 7,
        "seq": seq,
        "stamp_ns": START_NS + seq % 10**9 * 10,
        "position": (0.01 * (seq % 100), 0.0, 1.5),
        "velocity": (0.6, 0.0, 0.0),
        "yaw": 0.0,
        "mode": Wish.FLY,
    }
    return HandSample(**{**content, **fields})


def state(drone: int, seq: int, **fields: Any) -> DroneState:
    """Makes a state of a drone in epoch 8."""
    content = {"epoch": 8, "seq": seq, "stamp_ns": START_NS + seq * 10, "id": drone, "mode": Mode.FOLLOW}
    vectors = dict.fromkeys(("position", "velocity", "goal", "goal_velocity", "setpoint"), ZERO)
    return DroneState(**{**content, **vectors, **fields})


def flight(length: int) -> Payloads:
    """Makes payloads of a hand and of two drones in turn."""
    rounds = [
        [(HAND.key(), encode(hand(n))), *((DRONE_STATE.key(id=i), encode(state(i, n))) for i in (1, 2))]
        for n in range(length // 3)
    ]
    return [item for items in rounds for item in items]


def write(
    folder: Path,
    payloads: Payloads,
    every: int = 10,
    *,
    scenario: Scenario = SCENARIO,
    close: bool = True,
) -> Path:
    """Writes a trace with a chunk for `every` so many payloads, the n-th logged n ms after the start.

    Without `close` it is left as a killed recorder leaves it.
    """
    writer = TraceWriter(folder, scenario)
    for number, (key, payload) in enumerate(payloads):
        writer.add(key, Arrival(payload, START_NS + number * STEP_NS))
        if number % every == every - 1:
            writer.flush(dropped=0)
    if close:
        writer.close(dropped=0)
    else:
        writer._file.close()
    return writer.path
