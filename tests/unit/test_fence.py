"""The fence: around the formation at home, or where the scenario puts it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.settings import agent_settings, hand_settings
from shared.arrays import Vec, rest_of
from shared.config import SCENARIOS, load_scenario, structure_scenario
from shared.fence import fence_box
from shared.formation import build_formation
from shared.scenario import Scenario

SHIPPED = sorted(path.stem for path in SCENARIOS.glob("*.toml"))


def heading(yaw: float) -> Vec:
    """(3, 3) rotation about z."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def places(scenario: Scenario) -> Vec:
    """(2 N, 3) every drone on the ground below its place at home, and at the take-off height."""
    formation = build_formation(scenario)
    home = rest_of(formation) + np.array([*scenario.hand.home, 0.0])
    up = home + np.array([0.0, 0.0, scenario.limits.takeoff_height])
    return np.vstack([home * (1.0, 1.0, 0.0), up])


@pytest.mark.parametrize("name", SHIPPED)
def test_the_fence_of_a_scenario_that_ships_contains_it(name: str) -> None:
    scenario = load_scenario(name)
    low, high = map(np.array, fence_box(scenario, build_formation(scenario)))
    margin = np.array([scenario.fence.margin, scenario.fence.margin, 0.0])
    assert (places(scenario) >= low + margin).all()
    assert (places(scenario) <= high - margin).all()


@given(
    shape=st.sampled_from(["line", "vee", "grid", "rhombus", "triangle"]),
    n=st.integers(1, 40),
    room=st.floats(0.2, 10.0),
    home=st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0)),
    turns=st.booleans(),
    yaw=st.floats(-4.0, 4.0),
)
def test_an_automatic_fence_leaves_its_room_however_the_formation_turns(
    shape: str, n: int, room: float, home: tuple[float, float], turns: bool, yaw: float
) -> None:
    tree = {
        "formation": {"shape": shape, "n": n},
        "fence": {"room": room},
        "hand": {"home": list(home), "follow_yaw": turns},
    }
    scenario = structure_scenario(tree, "here")
    formation = build_formation(scenario)
    low, high = map(np.array, fence_box(scenario, formation))
    around = np.vstack([rest_of(formation), np.zeros(3)]) @ heading(yaw if turns else 0.0).T
    around[:, :2] += home
    assert (around[:, :2] >= low[:2] + room - 1e-9).all()
    assert (around[:, :2] <= high[:2] - room + 1e-9).all()
    assert low[2] < 0.0
    assert high[2] > scenario.limits.takeoff_height + 1.0


def test_a_corner_that_is_given_stands_and_the_other_is_found() -> None:
    tree = {"fence": {"min": [-9.0, -8.0, -7.0], "room": 1.0}, "hand": {"follow_yaw": False}}
    scenario = structure_scenario(tree, "here")
    low, high = map(np.array, fence_box(scenario, build_formation(scenario)))
    assert low == pytest.approx([-9.0, -8.0, -7.0])
    assert high == pytest.approx([1.0, 1.5, 3.2])


@given(
    shape=st.sampled_from(["line", "vee", "grid", "rhombus"]),
    n=st.integers(1, 20),
    yaw=st.floats(-4.0, 4.0),
    hand=st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0), st.floats(0.0, 9.0)),
    room=st.floats(0.5, 5.0),
)
def test_the_goal_formation_of_a_clamped_hand_fits(
    shape: str, n: int, yaw: float, hand: tuple[float, float, float], room: float
) -> None:
    tree = {"formation": {"shape": shape, "n": n}, "fence": {"room": room}}
    scenario = structure_scenario(tree, "here")
    formation = build_formation(scenario)
    settings = hand_settings(scenario, formation)
    low, high = map(np.array, fence_box(scenario, formation))
    mapped = np.clip(np.array(hand), settings.low, settings.high)
    goals = mapped + rest_of(formation) @ heading(yaw).T
    # A box that is smaller than the turning circle leaves the hand one point: its middle.
    fits = high[:2] - low[:2] >= 2.0 * (formation.radius + scenario.fence.margin)
    inside = (goals[:, :2] >= low[:2] + 0.15 - 1e-9) & (goals[:, :2] <= high[:2] - 0.15 + 1e-9)
    assert inside[:, fits].all()


def test_every_agent_gets_the_same_fence() -> None:
    scenario = load_scenario("rhombus")
    formation = build_formation(scenario)
    low, high = map(np.array, fence_box(scenario, formation))
    for drone in formation.ids:
        steering = agent_settings(scenario, formation, drone).steering
        assert steering.low == pytest.approx(low + np.array([0.15, 0.15, 0.0]))
        assert steering.high == pytest.approx(high - 0.15)
