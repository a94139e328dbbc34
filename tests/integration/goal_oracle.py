"""Eqs. 11-13 and the links of the rhombus, written out and independent of the control law of the agents.

Every goal is recomputed from what its own step had heard: which hand sample, which states, and how long ago.
The hand is mapped absolutely, it has no yaw, and it stays away from the fence.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt
from attrs import define, field
from scipy.linalg import expm

from shared.messages import DroneState, HandSample, Mode, Wish

Vec = npt.NDArray[np.float64]
Key = tuple[int, int]

M, D, K, KV = 1.9, 12.6, 21.0, -7.0
LIMIT = 0.12
"""Lower than the paper's 0.25 m, which short strokes would not reach."""
L = H = 0.5
MAX_HAND_SPEED, LONGEST_GAP = 0.75, 0.1
HAND_STALE, REFERENCE_LOST, EXTRAPOLATION = 0.25, 0.5, 0.25

REFERENCES: dict[int, tuple[int, ...]] = {1: (), 2: (1,), 3: (1,), 4: (2, 3)}
OFFSET = {1: (-L, 0.0, 0.0), 2: (-L, H, 0.0), 3: (-L, -H, 0.0), 4: (-L, 0.0, 0.0)}
LINKS = {1: 1, 2: 1, 3: 1, 4: 2}
GUIDED = (Mode.FOLLOW, Mode.HOLD)


@define
class Oracle:
    """Follows one drone step by step.

    Attributes:
        point: Mapped hand, m; None before the first.
        velocity: Its velocity, m/s.
        stamp_ns: Stamp of the sample that it was mapped from.
        link: Displacement and rate, (2, 3); all links into a drone are alike.
        met: How often each rule was needed that an undisturbed slow flight does not need.
    """

    drone: int
    hands: Mapping[Key, HandSample]
    states: Mapping[int, Mapping[Key, DroneState]]
    point: Vec | None = None
    velocity: Vec = field(factory=lambda: np.zeros(3))
    stamp_ns: int = 0
    link: Vec = field(factory=lambda: np.zeros((2, 3)))
    met: Counter[str] = field(factory=Counter)

    def goals(self, steps: Sequence[DroneState]) -> Iterator[tuple[DroneState, Vec | None]]:
        """Yields each guided step with its goal (3,), None where a reference was not usable."""
        previous: DroneState | None = None
        for state in steps:
            before = previous.heard if previous else {}
            fresh = {key: heard[:2] != before.get(key, (0, 0, 0))[:2] for key, heard in state.heard.items()}
            self._map_hand(state, fresh)
            dt = (state.step_ns - previous.step_ns) / 1e9 if previous else 1.0 / 60.0
            self._step_link(dt)
            if state.mode in GUIDED and self.point is not None:
                yield state, self._goal(state, fresh)
            previous = state

    def _map_hand(self, state: DroneState, fresh: Mapping[str, bool]) -> None:
        heard = state.heard.get("human/hand")
        if heard is None:
            return
        sample = self.hands.get(heard[:2])
        if sample is None:
            # The recorder links to a new relay a moment after the agents, long before anybody follows.
            assert state.mode not in GUIDED, heard
            return
        assert sample.yaw == 0.0
        if sample.mode is Wish.FLY and state.mode in (Mode.GROUND, Mode.TAKEOFF):
            self.point, self.stamp_ns = np.array(sample.position), sample.stamp_ns
        if state.mode is not Mode.FOLLOW or state.step_ns - heard.arrival_ns > HAND_STALE * 1e9:
            self.velocity = np.zeros(3)
            self.met["stale hand"] += state.mode is Mode.FOLLOW
        elif fresh["human/hand"]:
            self._pursue(sample)

    def _pursue(self, sample: HandSample) -> None:
        assert self.point is not None
        gap = (sample.stamp_ns - self.stamp_ns) / 1e9
        reach = MAX_HAND_SPEED * min(max(gap, 0.0), LONGEST_GAP)
        way = np.array(sample.position) - self.point
        distance = float(np.linalg.norm(way))
        if distance > reach:
            self.point = self.point + way / distance * reach
            self.velocity = way / distance * MAX_HAND_SPEED
            self.met["pursuit"] += 1
            self.met["pursuit after a gap"] += gap > LONGEST_GAP
        else:
            self.point, velocity = np.array(sample.position), np.array(sample.velocity)
            speed = float(np.linalg.norm(velocity))
            self.velocity = velocity * min(1.0, MAX_HAND_SPEED / speed) if speed > 0.0 else velocity
        self.stamp_ns = sample.stamp_ns

    def _step_link(self, dt: float) -> None:
        """M x'' + D x' + K x = Kv v over dt with v held: the matrix exponential of the augmented system."""
        system = np.zeros((3, 3))
        system[:2] = [[0.0, 1.0, 0.0], [-K / M, -D / M, KV / M]]
        self.link = (expm(system * dt) @ np.vstack([self.link, self.velocity]))[:2]

    def _goal(self, state: DroneState, fresh: Mapping[str, bool]) -> Vec | None:
        assert self.point is not None
        correction = LINKS[self.drone] * np.clip(self.link[0], -LIMIT, LIMIT)
        correction[0] = -abs(correction[0])
        self.met["limit"] += bool((np.abs(self.link[0]) > LIMIT).any())
        points = []
        for reference in REFERENCES[self.drone]:
            key = f"drone/{reference}/state"
            if key not in state.heard:
                return None
            heard = self.states[reference][state.heard[key][:2]]
            age = (state.step_ns - state.heard[key].arrival_ns) / 1e9
            if age > REFERENCE_LOST or heard.mode not in GUIDED:
                return None
            way = np.array(heard.velocity) * (0.0 if fresh[key] else age)
            length = float(np.linalg.norm(way))
            self.met["extrapolation"] += length > 0.001
            points.append(np.array(heard.position) + way * min(1.0, EXTRAPOLATION / max(length, 1e-9)))
        middle = np.mean(points, axis=0) if points else self.point
        # formation.height_from = "hand": the rest shape is flat, so a reference is as high as the hand.
        goal: Vec = np.array([*middle[:2], self.point[2]]) + OFFSET[self.drone] + correction
        return goal


def worst_error(
    drone: int, hands: Mapping[Key, HandSample], states: Mapping[int, Sequence[DroneState]]
) -> tuple[float, float, Counter[str]]:
    """Recomputes every goal that one drone published while it was part of the formation.

    Returns:
        The largest difference, m; the share of its goals in FOLLOW that could be recomputed; the rules met.
    """
    known = {i: {(s.epoch, s.seq): s for s in sequence} for i, sequence in states.items()}
    oracle = Oracle(drone, hands, known)
    worst, checked = 0.0, 0
    for state, goal in oracle.goals(states[drone]):
        if goal is not None:
            worst = max(worst, float(np.abs(goal - state.goal).max()))
            checked += state.mode is Mode.FOLLOW
    following = sum(state.mode is Mode.FOLLOW for state in states[drone])
    return worst, checked / max(following, 1), oracle.met
