"""Hand samples followed through a real flight in which one agent is slow and another one stops for a while."""

from collections.abc import Iterable
from pathlib import Path
from statistics import median

from observer.path.flight import RecordedFlight
from observer.path.follow import follow, most_unusual, typical
from observer.path.hop import Cause, HandPath, Part
from shared.formation import build_formation
from tests.integration.swarm import Swarm, swarm_of
from tests.integration.test_bench_swarms import slowed

MS = 1_000_000
SLOW_MS = 8
STALL_S = 0.3


def recorded(swarm: Swarm) -> RecordedFlight:
    heard = swarm.recorder
    states = (state for states in heard.states.values() for state in states)
    return RecordedFlight(build_formation(swarm.scenario), [*heard.hands.values(), *states])


def between(flight: RecordedFlight, begin_ns: int, end_ns: int) -> list[HandPath]:
    return [
        follow(flight, number)
        for number, hand in sorted(flight.hands.items())
        if begin_ns <= hand.stamp_ns < end_ns
    ]


def median_ms(paths: Iterable[HandPath], node: str, part: Part) -> float:
    return median(path.effects[node].inputs[0].parts_ns[part] for path in paths) / MS


def check_sums(paths: Iterable[HandPath]) -> None:
    """Whole chains from the hand to every drone, the times of whose hops add up to 1 us."""
    for path in paths:
        assert path.effects.keys() == {"drone 1", "drone 2", "drone 3", "drone 4"}
        for node in path.effects:
            parts = [took for hop in path.way(node) for took in hop.parts_ns.values()]
            assert parts
            assert abs(sum(parts) - path.latency_ns(node)) <= 1_000


def test_a_slow_and_a_stopped_agent_are_found_in_their_hops(tmp_path: Path) -> None:
    with swarm_of("rhombus", "scripted:tour", tmp_path, "limits.takeoff_height=0.3") as swarm:
        swarm._rows["drone/3"] = slowed("drone/3", SLOW_MS)(swarm._rows["drone/3"])
        swarm.fly()
        recorder = swarm.recorder
        begin_ns = recorder.clock()
        recorder.listen(2.0)
        stall_ns = recorder.clock()
        swarm.pause("drone/2", STALL_S)
        resumed_ns = recorder.clock()
        recorder.listen(1.0)
        flight = recorded(swarm)
    calm = between(flight, begin_ns, stall_ns - 100 * MS)
    assert len(calm) > 60
    check_sums(calm)
    computing = {node: median_ms(calm, node, Part.COMPUTE) for node in calm[0].effects}
    assert computing["drone 3"] >= SLOW_MS
    assert computing["drone 3"] > max(computing[f"drone {drone}"] for drone in (1, 2, 4)) + SLOW_MS / 2
    # Drone 4 either waits for drone 3, or has settled into stepping with its state of the sample before.
    marked = [
        path
        for path in calm
        if path.way("drone 4")[-1].sender == "drone 3" or "drone 3" in path.effects["drone 4"].lacked
    ]
    assert len(marked) > 0.8 * len(calm)

    usual = typical(flight)
    stalled = between(flight, stall_ns + 20 * MS, resumed_ns - 50 * MS)
    assert len(stalled) > 8
    check_sums(stalled)
    for path in stalled:
        excess = most_unusual(path, usual)
        assert excess is not None
        assert excess.hop.listener == "drone 2"
        assert excess.hop.cause in (Cause.LISTENER, Cause.NONE)
    print(f"n = {len(calm)} calm, {len(stalled)} stalled; median computing, ms: {computing}")
