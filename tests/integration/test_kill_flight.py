"""Kill -9 in flight: the body follows its link-loss rule, the others fly on, the process comes back."""

import os
import signal
import time
from collections.abc import Iterable
from pathlib import Path

import pytest

from agents.vehicles import open_vehicle
from shared.messages import Flag, Mode
from shared.vehicles import vehicle_settings
from tests.integration.recorder import RELAY, START_S, WORLD, Recorder, slowest_rate_hz
from tests.integration.swarm import Swarm, launched, swarm_of

pytestmark = pytest.mark.timeout(120)

HAND = "scripted:tour?peak=0.4"
LOWEST_RATE_HZ = 35.0
"""Of steps in any second, where the machine lets everybody run."""
CUT_S = 2.0
"""Link loss of a Crazyflie: its motors stop after so long without a command."""
START_LATE_NS = 1_500_000_000
"""A process that has started after so long commands its body before that."""


def check_others_flew_on(recorder: Recorder, drones: Iterable[int], start_ns: int) -> None:
    """Nobody blocked, crashed or landed: same process, steps at a good rate, all the time."""
    for drone in drones:
        states = recorder.since(drone, start_ns)
        assert len({state.epoch for state in states}) == 1
        assert slowest_rate_hz(states) >= LOWEST_RATE_HZ * recorder.floor.slowest_share(start_ns)
        assert {state.mode for state in states} <= {Mode.FOLLOW, Mode.HOLD}


def test_the_launcher_brings_an_agent_back_and_it_rejoins_in_the_air(tmp_path: Path) -> None:
    with launched("rhombus", HAND, tmp_path) as flight:
        recorder = flight.recorder
        recorder.until(lambda: "drone/2" in recorder.statuses, START_S)
        killed_ns = recorder.clock()
        os.kill(recorder.statuses["drone/2"].pid, signal.SIGKILL)

        def rejoined() -> bool:
            return recorder.latest(2).epoch > killed_ns and recorder.all_in(Mode.FOLLOW)

        recorder.until(rejoined, START_S)
        recorder.listen(1.5)
        summary = flight.end()
    back = [state for state in recorder.states[2] if killed_ns < state.epoch]
    # The recorder links to the new process only after its first steps; its log has them all.
    modes = modes_logged(flight.runs / "latest/logs/drone-2.log")
    flown = modes[: modes.index("LAND")]
    assert flown[-1] == "FOLLOW"
    # Only a machine too busy to start a process before its motors are cut lets the body fall.
    if back[0].epoch - killed_ns < START_LATE_NS:
        assert (flown.count("GROUND"), flown.count("TAKEOFF")) == (1, 1), "it read that its body is in the air"
        assert min(state.position[2] for state in back if state.mode is Mode.FOLLOW) > 0.5
    check_others_flew_on(recorder, (1, 3, 4), killed_ns)
    # Those that do not refer to it did not even hold.
    assert {state.mode for drone in (1, 3) for state in recorder.since(drone, killed_ns)} == {Mode.FOLLOW}
    assert (summary["restarts"], summary["collisions"], summary["fence_exits"]) == (1, 0, 0)
    assert summary["landed"] is True
    assert "Traceback" not in flight.logs()


def modes_logged(log: Path) -> list[str]:
    """Returns the modes that an agent has logged, those of its predecessors first."""
    return [
        line.split("agent: ")[1].split()[0] for line in log.read_text().splitlines() if " at height " in line
    ]


def watch_the_body(swarm: Swarm, drone: int, seconds: float) -> list[tuple[float, float]]:
    """Looks at a body whose agent is dead; returns (time since now, height)."""
    vehicle = open_vehicle(str(vehicle_settings(swarm.scenario, drone).uri))
    start, seen = time.monotonic(), []
    while (elapsed := time.monotonic() - start) < seconds:
        swarm.recorder.listen(0.01)
        pose = vehicle.pose()
        if pose is not None:
            seen.append((elapsed, pose.position[2]))
    vehicle.close()
    return seen


def test_an_agent_that_stays_dead_loses_its_body_and_rejoins_from_the_ground(tmp_path: Path) -> None:
    with swarm_of("rhombus", HAND, tmp_path) as swarm:
        swarm.fly()
        recorder = swarm.recorder
        killed_ns = swarm.kill("drone/1")
        seen = watch_the_body(swarm, 1, 4.0)
        assert min(height for t, height in seen if t < CUT_S - 0.2) > 0.5, (
            "it stays up until its motors are cut"
        )
        assert {height for t, height in seen if t > CUT_S + 1.5} == {0.0}, "then it falls"
        followers = [recorder.latest(drone) for drone in (2, 3, 4)]
        assert {state.mode for state in followers} == {Mode.FOLLOW}
        assert [Flag.REPAIRED in state.flags for state in followers] == [True, True, False]
        assert all(state.position[2] > 0.8 for state in followers)

        swarm.start("drone/1")
        recorder.until(lambda: recorder.all_in(Mode.FOLLOW), START_S)
        recorder.listen(1.5)
        assert modes_logged(tmp_path / "drone-1.log")[-2:] == ["TAKEOFF", "FOLLOW"]
        check_others_flew_on(recorder, (2, 3, 4), killed_ns)
        swarm.land()
        assert recorder.statuses[WORLD].metrics["collisions"] == 0.0
        assert set(swarm.end().values()) == {0}
        assert "Traceback" not in swarm.logs()


def test_relay_and_world_may_die_and_come_back(tmp_path: Path) -> None:
    with swarm_of("rhombus", HAND, tmp_path) as swarm:
        swarm.fly()
        recorder = swarm.recorder
        killed_ns = swarm.kill(RELAY)
        seconds = recorder.until(lambda: recorder.all_in(Mode.HOLD), START_S)
        assert seconds > 0.5, "a silent hand is no reason to hold at once"
        assert all(Flag.HAND_STALE in recorder.latest(drone).flags for drone in recorder.ids)
        swarm.start(RELAY)
        recorder.until(lambda: recorder.all_in(Mode.FOLLOW), START_S)
        recorder.listen(1.5)
        check_others_flew_on(recorder, recorder.ids, killed_ns)

        killed_ns = swarm.kill(WORLD)
        recorder.until(lambda: WORLD not in recorder.present, START_S)
        recorder.listen(1.0)
        swarm.start(WORLD)
        # A new world begins with everybody on the ground.
        recorder.until(lambda: all(recorder.latest(drone).position[2] < 0.1 for drone in recorder.ids), START_S)
        recorder.until(
            lambda: all(recorder.latest(drone).position[2] > 1.0 for drone in recorder.ids),
            START_S,
        )
        recorder.listen(1.5)
        for drone in recorder.ids:
            states = recorder.since(drone, killed_ns)
            assert len({state.epoch for state in states}) == 1
            assert slowest_rate_hz(states) >= LOWEST_RATE_HZ * recorder.floor.slowest_share(killed_ns)
        swarm.land()
        assert set(swarm.end().values()) == {0}
        assert "Traceback" not in swarm.logs()
