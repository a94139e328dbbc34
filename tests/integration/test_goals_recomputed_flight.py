"""Every goal that real processes published follows from what they say they had heard."""

from pathlib import Path

import pytest

from shared.messages import DroneState, Mode
from tests.integration.goal_oracle import LIMIT, worst_error
from tests.integration.recorder import RELAY, Recorder
from tests.integration.swarm import swarm_of

FLIGHT_S = 12.0
FAST_TOUR = "scripted:tour?peak=1.0"
"""Faster than the formation may follow, so that the pursuit of the hand is checked as well."""
PAUSES = [("drone/1", 0.2), (RELAY, 0.2), ("drone/2", 0.2), ("drone/1", 0.35), (RELAY, 0.4), ("drone/3", 0.3)]
"""Who is stopped and for how long, s: not long enough for anybody to be lost."""


ATTEMPTS = 3
"""Messages are best effort: where the machine is so busy that one is lost, the flight cannot be recomputed."""


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Recorder:
    """A disturbed flight of the rhombus with a moving hand, from the ground to the ground."""
    for _ in range(ATTEMPTS):
        recorder = record(tmp_path_factory.mktemp("goals"))
        if not recorder.losses:
            break
    return recorder


def record(folder: Path) -> Recorder:
    with swarm_of("rhombus", FAST_TOUR, folder, f"impedance.limit={LIMIT}") as swarm:
        swarm.fly()
        for token, seconds in PAUSES * 2:
            swarm.recorder.listen(FLIGHT_S / len(PAUSES) / 2 - seconds)
            swarm.pause(token, seconds)
        swarm.land()
        assert set(swarm.end().values()) == {0}
        return swarm.recorder


@pytest.mark.timeout(240)
def test_the_recording_is_complete(flight: Recorder) -> None:
    assert (flight.losses, flight.refused) == (0, 0)
    for states in flight.states.values():
        assert states[0].mode is states[-1].mode is Mode.GROUND
        assert len(states) > 40 * FLIGHT_S


@pytest.mark.timeout(120)
@pytest.mark.parametrize("drone", [1, 2, 3, 4])
def test_every_goal_follows_from_what_was_heard(flight: Recorder, drone: int) -> None:
    worst, share, met = worst_error(drone, flight.hands, flight.states)
    assert worst < 1e-9
    assert share >= 0.99
    # The flight must have been one that could go wrong.
    needed = {
        "pursuit",
        "pursuit after a gap",
        "limit",
        "stale hand",
        *(["extrapolation"] if drone > 1 else []),
    }
    assert {rule for rule in needed if met[rule] > 0} == needed


def test_the_displacements_are_those_that_were_published(flight: Recorder) -> None:
    followed: list[DroneState] = [s for s in flight.states[4] if s.mode is Mode.FOLLOW]
    assert max(abs(x) for s in followed for d in s.displacements.values() for x in d) > 0.1
    assert {tuple(sorted(state.displacements)) for state in followed} == {("2-4", "3-4")}
