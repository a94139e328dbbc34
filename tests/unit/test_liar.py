"""One member of a flying swarm lies about itself: the others neither follow nor flee, and say so."""

import math
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from deploy.lockstep.lockstep import Lockstep
from deploy.lockstep.start import start_flyers
from shared.config import load_scenario
from shared.formation import build_formation
from shared.messages import DroneState, Flag, HandSample, Mode, Places
from tests.hands import REST, still

BEGIN, END, LENGTH = 120, 420, 720
"""Ticks of 1/60 s: when it begins to lie, when it tells the truth again, and the whole flight."""

Lie = Callable[[DroneState, int], DroneState]
LIES: dict[str, Lie] = {
    "far away": lambda said, _: replace(said, position=(0.0, 60.0, 1.2)),
    "at the speed of a bullet": lambda said, _: replace(said, velocity=(0.0, 50.0, 0.0)),
    "wants to go far away": lambda said, _: replace(said, goal=(900.0, 0.0, 1.2)),
    "going away harder than anybody can": lambda said, _: replace(said, asked=(-45.0, 0.0, 0.0)),
    "to and fro over the others": lambda said, tick: replace(
        said, position=(said.position[0] + (-9.0 if tick % 2 else 9.0), *said.position[1:])
    ),
}


class Lying(Lockstep):
    """A swarm in lockstep of which one says something else than is."""

    liar: int
    lie: Lie | None

    def _publish(self, key: str, message: HandSample | DroneState | Places, now_ns: int) -> None:
        if (
            isinstance(message, DroneState)
            and message.id == self.liar
            and BEGIN <= self.tick < END
            and self.lie
        ):
            message = self.lie(message, self.tick)
        super()._publish(key, message, now_ns)


def fly(lie: Lie | None, liar: int, law: str) -> list[list[DroneState]]:
    """Flies a hand that rests; returns what everybody really did, tick by tick."""
    scenario = load_scenario("rhombus", [f"swarm.law={law}"])
    formation = build_formation(scenario)
    bodies = start_flyers(scenario, formation, (REST + formation.rest).tolist(), airborne=True)
    swarm = Lying(scenario, formation, bodies)
    swarm.liar, swarm.lie = liar, lie
    return [swarm.advance(sample) for sample in still(LENGTH / 60.0)]


@pytest.mark.parametrize("law", ["paper", "stable"])
@pytest.mark.parametrize("liar", [1, 4], ids=["whom two follow", "whom nobody follows"])
@pytest.mark.parametrize("lie", LIES)
def test_a_liar_moves_nobody_and_is_believed_again_when_it_tells_the_truth(
    lie: str, liar: int, law: str
) -> None:
    honest, lying = fly(None, liar, law), fly(LIES[lie], liar, law)
    for tick, (there, here) in enumerate(zip(honest, lying, strict=True)):
        for one, other in zip(there, here, strict=True):
            assert math.dist(one.position, other.position) < 0.12, (tick, one.id)
            # The liar is told that nobody hears it; what it does about that is its own affair.
            assert other.mode is Mode.FOLLOW or other.id == liar, (tick, other.id)
    during, after = lying[END - 1], lying[LENGTH - 1]
    others = [state for state in during if state.id != liar]
    assert all(Flag.REJECTED_INPUT in state.flags for state in others)
    assert not any((Flag.REJECTED_INPUT | Flag.REPAIRED) & state.flags for state in after)
