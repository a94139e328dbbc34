"""A drone that lies within the limits of a body drives the others before it, but not into each other."""

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
import pytest
from msgspec.structs import replace

from agents.agent import Agent
from deploy.falsify.air import Air, Message
from deploy.falsify.draw import Plan, draw_case
from deploy.falsify.swarm import fly, prepare
from shared.fence import fence_box
from shared.messages import DroneState, Mode, Vector

LIAR, HONEST = 4, (1, 2, 3)
BEGIN, CASES = 400, 4
SPEEDS = (0.0, 0.5, 1.0, 2.0, 4.9)
FLYING = 0.15
"""Who is lower stands or lands, m."""


class Liar:
    """Says that it chases one after the other, as fast as anybody is believed, and hears nobody."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._places: dict[int, Vector] = {}
        self._target, self._speed, self._left = 1, 0.0, 0

    def hear(self, state: DroneState) -> None:
        if state.id != LIAR or LIAR not in self._places:
            self._places[state.id] = state.position

    def lie(self, state: DroneState) -> DroneState:
        if not self._left:
            self._left = int(self._rng.integers(5, 60))
            self._target = int(self._rng.choice(HONEST))
            self._speed = float(self._rng.choice(SPEEDS))
        self._left -= 1
        own, there = self._places[LIAR], self._places[self._target]
        share = self._speed / max(math.dist(own, there), self._speed / 60.0, 1e-9)
        x, y, z = (share * (b - a) for a, b in zip(own, there, strict=True))
        a, b, c = own
        self._places[LIAR] = a + x / 60.0, b + y / 60.0, c + z / 60.0
        return replace(
            state,
            position=self._places[LIAR],
            velocity=(x, y, z),
            ahead=None,
            pace=None,
            unheard=HONEST,
            mode=Mode.FOLLOW,
        )


@pytest.mark.parametrize("body", ["identified", "crazyflie"])
def test_a_liar_drives_nobody_into_another_or_out_of_the_fence(
    body: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    publish = Air.publish
    liar = Liar(0)

    def corrupted(air: Air, message: Message, tick: int, agents: Sequence[Agent | None]) -> None:
        if isinstance(message, DroneState):
            liar.hear(message)
            if message.id == LIAR and tick > BEGIN:
                message = liar.lie(message)
        publish(air, message, tick, agents)

    monkeypatch.setattr(Air, "publish", corrupted)
    plan = Plan(scenarios=("rhombus",), faults=False, weather=False, overrides=(f"vehicles.all.body={body}",))
    rng = np.random.default_rng(5)
    for seed in range(CASES):
        liar = Liar(seed)
        case = draw_case(plan, rng)
        flown = fly(case).position[:, : len(HONEST)]
        low, high = fence_box(*prepare(case.scenario, case.overrides))
        assert np.all((flown > low) & (flown < high))
        for one, other in combinations(range(len(HONEST)), 2):
            both = np.minimum(flown[:, one, 2], flown[:, other, 2]) > FLYING
            assert np.all(np.hypot(*(flown[both, one, :2] - flown[both, other, :2]).T) >= 0.20)
