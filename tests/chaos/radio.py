"""The hand by radio, and nothing on the way back: every packet towards the relay is dropped by the kernel."""

from pathlib import Path

from shared.clock import NS_PER_S
from shared.nodes import RELAY, drone_node
from shared.topics import HAND
from tests.chaos.flight import ChaosFlight, chaos_flight
from tests.chaos.row import Row, judge
from tests.chaos.steps import REJOIN_S, all_follow, wait, watch_from_now

RESTARTED, LATE = 2, 4
RESTART_S = 0.25
"""A supervisor's pause before it starts a process again."""
FALL_S = 4.0
"""After so long without its agent a body is on the ground."""
HEARD_S = 2.0
"""Whoever starts, hears the hand so soon."""


def simplex(folder: Path) -> Row:
    """Flies with a relay that nothing reaches; one agent is restarted in the air, one is started late."""
    with chaos_flight(folder, protocol="radio", before=lambda flight: flight.lab.deafen(RELAY)) as flight:
        watch = watch_from_now(flight, (RESTARTED, LATE))
        for drone, pause in ((RESTARTED, RESTART_S), (LATE, FALL_S)):
            flight.kill(drone_node(drone))
            flight.recorder.listen(pause)
            flight.start(drone_node(drone))
        back = wait(flight, lambda: all_follow(flight, (RESTARTED, LATE)))
        flight.recorder.listen(1.5)
        heard = {drone: first_heard(flight, drone, watch.start_ns) for drone in (RESTARTED, LATE)}
        taken_in = flight.lab.taken_in(RELAY)
        return judge(
            "nothing reaches the relay; 2 restarted, 4 late",
            watch,
            recovered_s=back,
            demands=[(taken_in == 0, f"no packet is taken in by the relay's kernel, not {taken_in}")],
            times=[
                *((s, HEARD_S, f"drone {i} hears the hand within 2 s") for i, s in heard.items()),
                (back, REJOIN_S, "all back in 12 s"),
            ],
            notes=[f"drone {i} heard the hand {s:.2f} s after its start" for i, s in heard.items() if s],
        )


def first_heard(flight: ChaosFlight, drone: int, after_ns: int) -> float | None:
    """Returns when an agent that started after some moment first stepped with the hand, s from its start."""
    states = [state for state in flight.recorder.states[drone] if state.epoch > after_ns]
    return next(((s.step_ns - s.epoch) / NS_PER_S for s in states if HAND.key() in s.heard), None)
