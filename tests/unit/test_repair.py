"""Whoever is gone is stood in for by its own row, smoothly, and gives way to itself when it is back."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.agent import Agent
from agents.around import drones_around
from agents.company import SETTLING, Memory, look_around
from agents.control.modes import CRITICAL_BATTERY, HAND_LAND, LOW_BATTERY, POSE_LOST
from agents.control.repair import BLEND, REFERENCE_LOST, RETURN_AFTER, Reference, kin_order
from agents.control.safety.encounter import Clearance
from agents.control.step import Output, Settings, State, step
from agents.settings import agent_settings
from agents.vehicles.base import Pose
from shared.clock import NS_PER_S
from shared.codec import encode
from shared.config import load_scenario
from shared.formation import build_formation
from shared.messages import Flag, Mode, Vector, Wish
from shared.senses import Sensed
from shared.topics import DRONE_STATE
from shared.transport import Arrival
from tests.unit.test_agent import state as drone_state
from tests.unit.test_step import REST, TICK, hand, hovering, inputs, reference, repeat, said, settings
from tests.values import replace

GONE = None
SILENT_1 = reference(REST[1], age=REFERENCE_LOST + 0.01, fresh=False)
SILENT_2 = reference(REST[2], age=REFERENCE_LOST + 0.01, fresh=False)
SILENT_3 = reference(REST[3], age=REFERENCE_LOST + 0.01, fresh=False)


def fly(state: State, drone: int, rules: Settings, seconds: float, **changes: object) -> list[Output]:
    found = []
    for _ in range(round(seconds / TICK)):
        state, output = step(state, inputs(drone, **changes), rules, TICK)
        found.append(output)
    return found


@pytest.mark.parametrize(
    ("drone", "references"),
    [
        (2, [SILENT_1]),
        (2, [GONE]),
        (2, [reference(REST[1], mode=Mode.LAND)]),
        (4, [SILENT_2, reference(REST[3])]),
        (4, [SILENT_2, SILENT_3]),
        (4, [GONE, GONE]),
    ],
)
def test_at_rest_the_formation_keeps_its_shape_whoever_is_gone(
    drone: int, references: list[Reference | None]
) -> None:
    rules = settings(drone)
    for output in fly(hovering(drone, rules), drone, rules, 3.0, references=references):
        assert output.goal == pytest.approx(REST[drone], abs=1e-9)
        assert Flag.REPAIRED in said(output)
        assert Flag.REFERENCE_LOST not in said(output)


def test_with_every_ancestor_gone_the_human_leads_alone() -> None:
    rules = settings(4)
    state, now = hovering(4, rules), replace(inputs(4), references=[SILENT_2, SILENT_3, SILENT_1])
    for k in range(120):
        moved = hand(-0.3 * k * TICK, velocity=(-0.3, 0, 0), stamp=k * TICK)
        state, output = step(state, replace(now, hand=moved), rules, TICK)
    assert state.mode.mode is Mode.FOLLOW
    assert output.goal[0] < REST[4][0] - 0.4


def test_a_stand_in_moves_its_links_as_the_lost_drone_would() -> None:
    """Hand in motion: the goal behind a lost drone 1 is where it would be with drone 1 on its goal."""
    rules, lead = settings(2), settings(1)
    follower, leader = hovering(2, rules), hovering(1, lead)
    for k in range(240):
        velocity = 0.4 * math.sin(2.0 * math.pi * k / 120)
        moved = hand(-0.2 * math.sin(math.pi * k / 120) ** 2, velocity=(-velocity, 0, 0), stamp=k * TICK)
        leader, led = step(leader, inputs(1, hand=moved), lead, TICK)
        follower, output = step(follower, inputs(2, hand=moved, references=[SILENT_1]), rules, TICK)
    expected = inputs(2, hand=moved, references=[reference(led.goal)])
    healthy = replace(follower, stand_ins=hovering(2, rules).stand_ins)
    _, wanted = step(healthy, expected, rules, TICK)
    assert output.goal == pytest.approx(wanted.goal, abs=0.02)


def test_the_stand_in_takes_over_and_gives_back_without_a_jump() -> None:
    rules = settings(2)
    astray = (REST[1][0] - 0.4, 0.3, 1.2)
    state = hovering(2, rules)
    state, _ = repeat(state, inputs(2, references=[reference(astray)]), rules, 3.0)
    lost = reference(astray, age=REFERENCE_LOST + 0.01, fresh=False)
    goals = [output.goal for output in fly(state, 2, rules, BLEND + 0.5, references=[lost])]
    longest = math.dist(astray, REST[1]) * TICK / BLEND
    assert max(math.dist(a, b) for a, b in itertools.pairwise(goals)) <= 1.01 * longest
    assert goals[-1] == pytest.approx(REST[2], abs=1e-9)


def test_who_is_back_is_trusted_only_after_a_while() -> None:
    rules = settings(2)
    state, _ = repeat(hovering(2, rules), inputs(2, references=[SILENT_1]), rules, 2.0)
    astray = reference((REST[1][0] - 0.4, 0.3, 1.2))
    flickering = [astray if k % 30 else SILENT_1 for k in range(180)]
    for known in flickering:
        state, output = step(state, inputs(2, references=[known]), rules, TICK)
        assert output.goal == pytest.approx(REST[2], abs=1e-9)
    back = fly(state, 2, rules, RETURN_AFTER + BLEND + 0.2, references=[astray])
    before = [o for k, o in enumerate(back) if k * TICK < RETURN_AFTER - 0.6]
    assert all(o.goal == pytest.approx(REST[2], abs=1e-9) for o in before)
    assert back[-1].goal == pytest.approx(np.add(REST[2], (-0.4, 0.3, 0.0)), abs=1e-9)
    assert Flag.REPAIRED not in said(back[-1])


def test_a_holding_drone_behind_a_lost_one_is_held() -> None:
    """A follower of a lost follower of one that holds does not fly on alone."""
    rules = settings(4)
    holding = replace(inputs(4), references=[SILENT_2, SILENT_3, reference(REST[1], mode=Mode.HOLD)])
    state, _ = repeat(hovering(4, rules), holding, rules, 1.0)
    assert state.mode.mode is Mode.HOLD
    following = replace(holding, references=[SILENT_2, SILENT_3, reference(REST[1])])
    state, _ = repeat(state, following, rules, 0.1)
    assert state.mode.mode is Mode.FOLLOW


def test_nobody_is_replaced_while_the_swarm_lands_or_waits_on_the_ground() -> None:
    rules = settings(2)
    down = inputs(2, wish=Wish.LAND, references=[reference(REST[1], mode=Mode.LAND)])
    state, output = repeat(hovering(2, rules), down, rules, 1.0)
    assert state.mode.mode is Mode.LAND
    assert Flag.REPAIRED not in said(output)


@given(
    st.integers(1, 12).flatmap(
        lambda n: st.lists(st.lists(st.integers(0, 11), max_size=3), min_size=n, max_size=n)
    )
)
def test_kin_are_all_ancestors_each_once_and_the_references_first(chosen: list[list[int]]) -> None:
    picked = [[each % k for each in picks] if k else [] for k, picks in enumerate(chosen)]
    references = {k: tuple(dict.fromkeys(picks)) for k, picks in enumerate(picked)}
    drone = len(chosen) - 1
    order = kin_order(references, drone)
    assert order[: len(references[drone])] == references[drone]
    assert len(set(order)) == len(order)
    assert all(set(references[each]) <= set(order) for each in order)


@pytest.mark.parametrize(
    ("battery", "flag"), [(LOW_BATTERY, Flag.LOW_BATTERY), (CRITICAL_BATTERY, Flag.CRITICAL_BATTERY)]
)
def test_a_low_battery_is_told_and_a_critical_one_lands(battery: float, flag: Flag) -> None:
    rules = settings(1)
    state, output = repeat(hovering(1, rules), inputs(1, battery=battery), rules, 0.5)
    assert flag in said(output)
    assert state.mode.mode is (Mode.LAND if flag is Flag.CRITICAL_BATTERY else Mode.FOLLOW)
    assert state.mode.must_ask_again is (flag is Flag.CRITICAL_BATTERY)


def test_an_old_pose_is_told_and_a_lost_one_descends_open_loop_until_the_motors_stop() -> None:
    rules = settings(1)
    state, output = repeat(hovering(1, rules), inputs(1, pose_age=POSE_LOST - 0.01), rules, 0.2)
    assert Flag.OLD_POSE in said(output)
    assert state.mode.mode is Mode.FOLLOW
    blind = inputs(1, pose_age=POSE_LOST + 0.01)
    state, output = repeat(state, blind, rules, 0.2)
    assert state.mode.mode is Mode.LAND
    state, _ = repeat(state, blind, rules, 1.2 / 0.5 + 0.5)
    assert state.mode.mode is Mode.GROUND
    state, _ = repeat(state, inputs(1, position=(-0.5, 0.0, 0.0)), rules, 0.5)
    assert state.mode.mode is Mode.TAKEOFF, "the operator still wants to fly, and it can see again"


def silent_ages(seconds: list[float], *overrides: str) -> list[tuple[int, int]]:
    """Returns how many drones are avoided, and how many that do not yield, at some ages of drone 2."""
    scenario = load_scenario("rhombus", overrides)
    formation = build_formation(scenario)
    brain = Agent(scenario, formation, 1, agent_settings(scenario, formation, 1), epoch=0)
    brain.receive({DRONE_STATE.key(id=2): [Arrival(encode(drone_state(2, seq=0)), NS_PER_S)]})
    at: Vector = (-0.5, 0.0, 1.2)
    pose = Pose(at, (0.0, 0.0, 0.0), 0.0, 1.0, True, 1)
    found = []
    for age in seconds:
        now = round((1.0 + age) * NS_PER_S)
        found.append(brain._inputs(now, pose, 0.0, brain._look_around(now)))
    return [(len(now.drones), sum(not each.yields for each in now.drones)) for now in found]


def test_who_stands_on_the_ground_and_says_so_seldom_is_there_and_nowhere_else() -> None:
    """Who waits steps ten times a second; who flies and is as silent may be at any height."""
    for mode, above in ((Mode.GROUND, 1.0), (Mode.FOLLOW, math.inf)):
        seen = Sensed(drone_state(2, seq=0, mode=mode), 0)
        company = look_around(
            1, {2: Memory(hovers=False, takeoff_height=1.2, landing_speed=0.5)}, {2: seen}, {}, NS_PER_S // 5
        )
        (met,) = drones_around(company, {2: Clearance(0.3, 1.0, 3.0)}, 0.0, NS_PER_S // 5)
        assert met.above == above


def test_a_silent_body_is_kept_away_from_until_it_must_be_down() -> None:
    """After the ladder: 10 s without the hand, the way down, and what a landing takes longer."""
    down = HAND_LAND + 1.2 / 0.5 + SETTLING
    assert silent_ages([0.0, 0.05, 0.2, 5.1, down - 0.1, down + 0.1]) == [
        (1, 0),
        (1, 0),
        (1, 1),
        (1, 1),
        (1, 1),
        (0, 0),
    ]


def test_a_body_that_hovers_without_its_agent_is_never_forgotten() -> None:
    assert silent_ages([1e5], "vehicles.all.link_loss=hover") == [(1, 1)]
