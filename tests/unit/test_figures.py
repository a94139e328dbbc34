"""The paper's figures 5-9 as statements: how links, goal, limit and formation answer to a hand."""

import numpy as np
import numpy.typing as npt
import pytest

from deploy.lockstep.lockstep import fly_lockstep
from deploy.lockstep.record import Record
from shared.arrays import rest_of
from shared.config import load_scenario
from shared.formation import build_formation
from tests.hands import stroke

pytestmark = pytest.mark.slow

Vec = npt.NDArray[np.float64]

FORWARD, RIGHT = np.pi, np.pi / 2.0
LIMIT = 0.25


def fly(
    heading: float, peak: float, length: float = 1.0, *, after: float = 6.0, max_speed: float = 0.75
) -> Record:
    scenario = load_scenario("rhombus", ["fence.room=5.0", f"hand.max_speed={max_speed}"])
    return fly_lockstep(scenario, build_formation(scenario), stroke(heading, length, peak, after=after))


def displacement(record: Record, link: str) -> Vec:
    names = [each.name for each in record.formation.links]
    return record.displacement[:, names.index(link)]


def test_figure_5_a_link_answers_the_hand_velocity_smoothly_and_returns_to_rest() -> None:
    record = fly(FORWARD, 0.4)
    x = displacement(record, "human-1")[:, 0]
    speed = record.hand.velocity[:, 0]
    assert np.argmax(np.abs(x)) > np.argmax(np.abs(speed)), "the displacement lags the velocity"
    assert np.sign(x[np.argmax(np.abs(x))]) == -np.sign(speed[np.argmax(np.abs(speed))]), "against the motion"
    assert np.abs(np.diff(x)).max() < 0.02, "no jumps"
    assert abs(x[-1]) < 1e-3, "back at rest"
    assert x.max() < 1.02 * 7.0 / 21.0 * 0.4, "critically damped: no more than the steady state Kv v / K"


def test_figure_6_the_goal_of_drone_1_is_the_hand_moved_by_the_link() -> None:
    record = fly(RIGHT, 0.4)
    goal, hand = record.goal[:, 0], record.hand.position
    link = np.clip(displacement(record, "human-1"), -LIMIT, LIMIT)
    assert goal[:, 1] == pytest.approx(hand[:, 1] + link[:, 1])
    moving = np.abs(record.hand.velocity[:, 1]) > 0.2
    assert (goal[moving, 1] < hand[moving, 1]).all(), "the goal lags a hand that moves to the right"
    assert goal[-1, 1] == pytest.approx(hand[-1, 1], abs=1e-3), "and catches up with it"


def test_figure_7_the_limit_flattens_the_goal_but_not_the_link() -> None:
    record = fly(RIGHT, 1.3, length=2.0, max_speed=1.5)
    link = displacement(record, "human-1")[:, 1]
    shift = record.goal[:, 0, 1] - record.hand.point[:, 1]
    beyond = np.abs(link) > LIMIT
    assert np.abs(link).max() > 1.2 * LIMIT
    assert np.abs(shift[beyond]) == pytest.approx(LIMIT)
    assert shift[~beyond] == pytest.approx(link[~beyond])


def test_figure_8_the_formation_stretches_along_its_motion() -> None:
    for heading in (0.0, FORWARD):
        record = fly(heading, 0.6)
        depth = record.goal[:, 0, 0] - record.goal[:, 3, 0]
        rest = depth[0]
        assert rest == pytest.approx(1.0)
        assert depth.max() > rest + 0.2, "longer along x while it moves, forward or backward"
    goal_ahead = record.goal[:, 0, 0] - record.hand.position[:, 0]
    assert goal_ahead.max() <= -0.5 + 1e-9, "and never nearer to the human than at rest"


def test_figure_9_the_formation_returns_to_its_rest_shape() -> None:
    record = fly(np.pi / 3.0, 0.6, after=14.0)
    shape = record.position[-1, :, :2] - record.hand.position[-1, :2]
    assert shape == pytest.approx(rest_of(record.formation)[:, :2], abs=0.05)
    widest = np.linalg.norm(record.position[:, 1] - record.position[:, 2], axis=1)
    assert widest[-1] == pytest.approx(1.0, abs=0.05)


def test_the_paper_law_lags_more_with_every_hop() -> None:
    record = fly(0.0, 0.5, length=1.5)  # away from the drones: none of them has to give way to the hand
    middle = np.searchsorted(record.hand.position[:, 0], 0.75)
    behind = record.hand.position[middle, 0] + rest_of(record.formation)[:, 0] - record.position[middle, :, 0]
    assert behind[0] < behind[1] < behind[3]
    assert behind[1] == pytest.approx(behind[2], abs=1e-6)
