"""Goals of the simulators against an independent oracle: Eqs. 11-13 written out, links by matrix exponential.

Nothing here imports `agents.control`. Jacobi ordering: every goal of tick k is made of the hand and the
positions of tick k (DESIGN section 4).
"""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from scipy.linalg import expm

from deploy.lockstep.central import fly_central
from deploy.lockstep.hand_track import relayed
from deploy.lockstep.lockstep import fly_lockstep
from deploy.lockstep.record import Record
from shared.config import load_scenario
from shared.formation import build_formation
from shared.messages import HandSample
from shared.scenario import Scenario
from tests.replay.flights import DATA, longest_flight

Vec = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]

M, D, K, KV, LIMIT, L, H = 1.9, 12.6, 21.0, -7.0, 0.25, 0.5, 0.5
RATE = 60.0
TOLERANCE = 1e-12


def displacements(velocity: Vec, stamps_ns: Stamps) -> Vec:
    """The one displacement (T, 3) that all links of the rhombus share: they have the same parameters."""
    state, out = np.zeros((2, 3)), np.empty_like(velocity)
    known: dict[float, Vec] = {}
    for k, v in enumerate(velocity):
        dt = (stamps_ns[k] - stamps_ns[k - 1]) / 1e9 if k else 1.0 / RATE
        if dt not in known:
            augmented = np.array([[0, 1, 0], [-K / M, -D / M, KV / M], [0, 0, 0]])
            known[dt] = np.asarray(expm(augmented * dt))[:2]
        state = known[dt][:, :2] @ state + np.outer(known[dt][:, 2], v)
        out[k] = np.clip(state[0], -LIMIT, LIMIT)
    return out


def oracle(samples: list[HandSample], position: Vec, *, height_from: str) -> Vec:
    """Goals (T, 4, 3) of the rhombus from the hand and the bodies (T, 4, 3)."""
    hand = np.array([s.position for s in samples])
    stamps_ns = np.array([s.stamp_ns for s in samples], dtype=np.int64)
    d = displacements(np.array([s.velocity for s in samples]), stamps_ns)
    one_link = np.column_stack([-np.abs(d[:, 0]), d[:, 1], d[:, 2]])
    two_links = 2.0 * one_link
    p1, p2, p3 = position[:, 0].copy(), position[:, 1].copy(), position[:, 2].copy()
    if height_from == "hand":
        for p in (p1, p2, p3):
            p[:, 2] = hand[:, 2]
    return np.stack(
        [
            hand + np.array([-L, 0.0, 0.0]) + one_link,
            p1 + np.array([-L, H, 0.0]) + one_link,
            p1 + np.array([-L, -H, 0.0]) + one_link,
            (p2 + p3) / 2.0 + np.array([-L, 0.0, 0.0]) + two_links,
        ],
        axis=1,
    )


def rhombus(start: Vec, height_from: str) -> Scenario:
    """The rhombus about the hand's first position, with a fence that is not in the way."""
    return load_scenario(
        "rhombus",
        [
            f"hand.home=[{start[0]}, {start[1]}]",
            "hand.follow_yaw=false",
            "fence.room=6.0",
            f'formation.height_from="{height_from}"',
        ],
    )


def worst_error(record: Record, samples: list[HandSample], height_from: str) -> float:
    return float(np.abs(record.goal - oracle(samples, record.position, height_from=height_from)).max())


def check(uri: str, seconds: float, height_from: str) -> None:
    samples = relayed(uri, seconds, RATE)
    assert len(samples) >= seconds * RATE - 1
    scenario = rhombus(np.array(samples[0].position), height_from)
    formation = build_formation(scenario)
    for fly in (fly_lockstep, fly_central):
        record = fly(scenario, formation, samples)
        moved = np.ptp(record.goal[:, 0, 0])
        assert moved > 0.2, "a hand that hardly moves proves nothing"
        assert worst_error(record, samples, height_from) < TOLERANCE, fly.__name__


@pytest.mark.timeout(240)
@pytest.mark.parametrize("height_from", ["hand", "references"])
def test_the_goals_are_eqs_11_to_13_over_60_s_of_a_recorded_hand(height_from: str) -> None:
    folder: Path = longest_flight()
    assert folder.is_relative_to(DATA)
    check(f"recording:{folder}?lead=0", 60.0, height_from)


@pytest.mark.timeout(120)
@pytest.mark.parametrize("height_from", ["hand", "references"])
def test_the_goals_are_eqs_11_to_13_of_a_scripted_hand(height_from: str) -> None:
    check("scripted:tour?lead=0.5&duration=30", 20.0, height_from)
