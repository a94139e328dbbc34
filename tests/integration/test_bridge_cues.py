"""Safety cues end to end: the right one, soon, and before any other pattern."""

from pathlib import Path

import pytest

from shared.clock import NS_PER_S
from shared.messages import Flag
from tests.integration.bridged import BridgedSwarm, bridged
from tests.integration.recorder import RELAY, START_S

pytestmark = pytest.mark.timeout(120)

SOON_NS = NS_PER_S
"""Half a second of silence and a pattern that is in the way, where the machine lets everybody run."""


def check_first(swarm: BridgedSwarm, cue: str, since_ns: int) -> None:
    swarm.recorder.until(lambda: bool(swarm.felt_since(since_ns)), START_S)
    event = swarm.listener.started(since_ns)[0]
    print(f"{cue}: {(event.started_ns - since_ns) / 1e6:.0f} ms")
    assert event.pattern == cue
    late_ns = swarm.recorder.floor.late_ms(100.0, since_ns) * 1e6
    assert event.started_ns - since_ns <= SOON_NS + 2 * late_ns


def test_a_killed_agent_and_a_silent_relay_are_felt(tmp_path: Path) -> None:
    with bridged(tmp_path, "flight") as swarm:
        swarm.fly()
        paused_ns = swarm.recorder.clock()
        swarm.pause(RELAY, 1.5)
        check_first(swarm, "HAND_STALE", paused_ns)

        swarm.recorder.listen(1.5)
        killed_ns = swarm.kill("drone/4")
        check_first(swarm, "DRONE_LOST", killed_ns)
        (lost,) = swarm.listener.started(killed_ns)[:1]
        assert set(lost.heard) == {"drone/4/state"}
        swarm.recorder.until(lambda: bool(lost_states(swarm)), START_S)
        shown = [line for line in swarm.frames() if line["pattern"] == "DRONE_LOST"]
        assert shown[0]["hz"] == [250.0] * 5
        assert shown[0]["t_ns"] == lost.started_ns
        assert "Traceback" not in swarm.logs()


def lost_states(swarm: BridgedSwarm) -> list[tuple[int, ...]]:
    swarm.listener.drain()
    return [state.missing for state in swarm.listener.states if state.missing == (4,)]


def test_pushing_against_the_fence_is_felt(tmp_path: Path) -> None:
    hand = "scripted:sweep?stroke=1.5&peak=0.4"
    with bridged(tmp_path, "flight", hand, "fence.room=0.4") as swarm:
        swarm.fly()

        def pushed() -> list[int]:
            return [s.stamp_ns for d in swarm.ids for s in swarm.recorder.states[d] if Flag.FENCE in s.flags]

        swarm.recorder.until(lambda: bool(pushed()), START_S)
        check_first(swarm, "FENCE", min(pushed()))
        assert "Traceback" not in swarm.logs()
