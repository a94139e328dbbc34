"""`swarmtouch falsify`: flights with faults and weather, their judge, and the search among them."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from attrs import evolve

from agents.agent import Agent
from agents.vehicles.world.referee import Rules
from agents.vehicles.world.setup import referee_rules
from deploy.cli import main
from deploy.falsify.air import Air, Message
from deploy.falsify.case import Case, Fault, FaultKind, Stroke, Weather, Wished
from deploy.falsify.change import change
from deploy.falsify.draw import FASTEST_HAND, Plan, draw_case
from deploy.falsify.hand import poses, samples, tracked
from deploy.falsify.judge import CLASSES, broken, judge
from deploy.falsify.keep import load_case, save_case
from deploy.falsify.search import Budget, Finds, search, try_case
from deploy.falsify.swarm import Flown, fly, prepare
from deploy.lockstep.hand_track import relayed
from deploy.lockstep.lockstep import fly_lockstep
from deploy.lockstep.record import judge as referee
from shared.codec import decode, encode
from shared.envelope import load_envelope
from shared.errors import ConfigError
from shared.fence import bodies_of
from shared.messages import DroneState, Wish
from shared.plausibility import check_ahead, check_possible

LEFT, RIGHT, REST = (0.0, -0.4, 1.2), (0.0, 0.4, 1.2), (0.0, 0.0, 1.2)
SWAY = tuple(Stroke(to=to, peak=0.4, rest=0.3) for to in (LEFT, RIGHT) * 9)
CALM = Case(scenario="rhombus", seconds=4.0, hand=REST, strokes=SWAY)


def rules_of(case: Case) -> Rules:
    scenario, formation = prepare(case.scenario, case.overrides)
    return referee_rules(scenario, formation, formation.ids)


def fail(kind: FaultKind, drone: int, start: float, end: float, seconds: float = 6.0) -> Case:
    return evolve(CALM, seconds=seconds, faults=(Fault(kind=kind, drone=drone, start=start, end=end),))


def gone_from(flown: Flown, row: int, t: float) -> float:
    """Returns how far a body has moved since a time, at most, m."""
    since = flown.t >= t
    path = flown.position[since, row]
    return float(np.linalg.norm(path - path[0], axis=1).max())


def flight(places: Any, counts: Any) -> Flown:
    """Returns bodies at places, a tick per second, all able or not, with a hand at the origin."""
    ticks, n = counts.shape
    vehicle = load_envelope("identified").horizontal
    return Flown(
        t=np.arange(float(ticks)),
        hand=np.zeros((ticks, 3)),
        position=np.asarray(places),
        able=counts,
        hearing=counts,
        guided=counts,
        vehicles=(vehicle,) * n,
    )


@pytest.mark.parametrize("law", ["paper", "stable"])
@pytest.mark.parametrize("airborne", [True, False])
def test_without_faults_and_weather_it_is_the_lockstep_flight(law: str, airborne: bool) -> None:
    case = evolve(CALM, airborne=airborne, overrides=(f"swarm.law={law}",))
    scenario, formation = prepare(case.scenario, case.overrides)
    hand = samples(case, poses(case, scenario.rates.control_hz))
    record = fly_lockstep(scenario, formation, hand, airborne=airborne)
    assert np.array_equal(fly(case).position, record.position)
    assert np.ptp(record.position, axis=0).max() > 0.3


def test_the_judge_agrees_with_the_referee() -> None:
    case = evolve(CALM, scenario="slalom")
    scenario, formation = prepare(case.scenario, case.overrides)
    record = fly_lockstep(scenario, formation, samples(case, poses(case, scenario.rates.control_hz)))
    told, found = referee(record, rules_of(case)), judge(fly(case), rules_of(case))
    assert found["drones"].value == pytest.approx(told["min_distance_m"])
    assert list(found["drones"].drones) == [told["min_distance_from"], told["min_distance_to"]]
    assert found["hand"].value == pytest.approx(told["min_hand_distance_m"])
    assert not told["collisions"]
    assert not broken(found)


def test_every_class_can_be_broken() -> None:
    rules = rules_of(evolve(CALM, scenario="slalom"))
    _, (high_x, high_y, high_z) = rules.fence
    column = rules.columns[0]
    places = np.array(
        [
            [(0.0, -1.0, 1.0), (0.0, 1.0, 1.0)],
            [(0.0, 0.0, 1.0), (0.19, 0.0, 1.0)],
            [(high_x + 0.03, 0.0, 1.0), (0.0, 0.0, 1.0)],
            [(0.0, high_y + 0.04, 1.0), (0.0, 0.0, 1.0)],
            [(0.0, 0.0, high_z + 0.05), (0.0, 0.0, 0.0)],
            [(column.x, column.y, 1.0), (0.0, 0.0, 1.0)],
        ]
    )
    yes = np.ones(places.shape[:2], dtype=bool)
    flown = flight(places, yes)
    found = judge(evolve(flown, hand=flown.hand + np.array([0.24, 0.0, 1.0])), evolve(rules, ids=(1, 2)))
    assert set(broken(found)) == set(CLASSES)
    assert found["fence_y"].value == pytest.approx(0.04)
    assert found["fence_y"].t == 3.0
    assert (found["floor"].value, found["floor"].drones) == (0.0, (2,))


APART, NEAR = (1.0, 0.0, 1.2), (0.1, 0.0, 1.2)


def test_who_cannot_help_it_is_not_judged() -> None:
    places = np.array([[REST, APART, (2.0, 0.0, 1.0)], [REST, (0.1, 0.0, 1.2), (5.0, 0.0, 1.0)]])
    yes, no = np.ones((2, 3), dtype=bool), np.zeros((2, 3), dtype=bool)
    flown = evolve(flight(places, no), hand=np.array([(0.0, 1.0, 1.2), (0.0, 0.2, 1.2)]))
    rules = evolve(rules_of(CALM), ids=(1, 2, 3))
    assert not broken(judge(flown, rules))
    assert broken(judge(evolve(flown, able=yes), rules)) == ["drones", "fence_x"]
    moved = evolve(flown, position=np.array([places[0] - (0.0, 1.0, 0.0), places[1]]), able=yes, hearing=yes)
    resting = evolve(moved, hand=np.full((2, 3), (0.0, 0.2, 1.2)))
    assert "hand" in broken(judge(resting, rules)), "it flew there itself"


def test_what_began_while_nobody_could_help_it_is_judged_once_it_is_over() -> None:
    rules = evolve(rules_of(CALM), ids=(1, 2))
    places = np.array([[REST, place] for place in (APART, NEAR, NEAR, APART, NEAR)])
    able = np.array([[True] * 2, [False] * 2, [True] * 2, [True] * 2, [True] * 2])
    assert judge(flight(places, able), rules)["drones"].t == 4.0
    assert not broken(judge(flight(places[:4], able[:4]), rules))
    assert not broken(judge(flight(places[1:4], np.ones((3, 2), dtype=bool)), rules)), "it began there"


@pytest.mark.parametrize(("peak", "fair"), [(0.3, True), (6.0, False)])
def test_a_hand_is_judged_if_a_body_could_have_fled_from_it(peak: float, fair: bool) -> None:
    """A body that does not move is hit by both; from the slow one it could have got away."""
    t = np.arange(240) / 60.0
    hand = np.zeros((240, 3)) + np.array([-0.6, 0.0, 1.0])
    hand[:, 0] += np.clip(peak * (t - 0.5), 0.0, 0.6)
    flown = flight(np.full((240, 1, 3), (0.0, 0.0, 1.0)), np.ones((240, 1), dtype=bool))
    rules = evolve(rules_of(CALM), ids=(1,))
    assert ("hand" in broken(judge(evolve(flown, t=t, hand=hand), rules))) is fair
    walled = evolve(rules, fence=((-2.0, -0.1, 0.0), (0.1, 0.1, 2.0)))
    assert "hand" not in broken(judge(evolve(flown, t=t, hand=hand), walled)), "it was trapped"


def test_a_drone_that_is_cut_off_flies_on_by_its_own_ladder_and_lands() -> None:
    flown = fly(fail("cut", 2, 1.0, math.inf, seconds=17.0))
    assert gone_from(flown, 1, 3.0) > 1.0, "it lands after 10 s without the hand"
    assert flown.position[-1, 1, 2] == pytest.approx(0.0, abs=0.01)
    hold = (flown.t > 4.0) & (flown.t < 10.0)
    assert np.ptp(flown.position[hold, 1], axis=0).max() < 0.05
    assert np.ptp(flown.position[hold, 0], axis=0).max() > 0.2, "the others follow the hand"
    assert not flown.hearing[flown.t > 2.0, 1].any()


@pytest.mark.parametrize(("rule", "height"), [("crazyflie", 0.0), ("hover", 1.2)])
def test_the_body_of_a_killed_agent_obeys_its_link_loss_rule(rule: str, height: float) -> None:
    case = evolve(fail("kill", 3, 1.0, math.inf), overrides=(f"vehicles.all.link_loss={rule}",))
    flown = fly(case)
    assert flown.position[-1, 2, 2] == pytest.approx(height, abs=0.02)
    assert not flown.able[flown.t > 1.0, 2].any()


def test_a_killed_agent_comes_back_and_holds() -> None:
    case = evolve(fail("kill", 3, 1.0, 2.0), overrides=("vehicles.all.link_loss=hover",))
    flown = fly(case)
    assert flown.able[-1].all()
    assert flown.guided[-1].all()


def test_a_held_drone_stays_until_it_is_let_go() -> None:
    flown = fly(fail("held", 4, 0.0, 3.0))
    held = flown.t < 3.0
    assert np.ptp(flown.position[held, 3], axis=0).max() == 0.0
    assert gone_from(flown, 3, 3.1) > 0.1


@pytest.mark.parametrize("kind", ["blind", "empty"])
def test_a_drone_without_pose_or_charge_lands(kind: FaultKind) -> None:
    assert fly(fail(kind, 1, 1.0, math.inf, seconds=8.0)).position[-1, 0, 2] == pytest.approx(0.0, abs=0.01)


def test_a_silent_relay_makes_everybody_hold() -> None:
    flown = fly(fail("relay", 0, 1.0, math.inf))
    assert not flown.hearing[flown.t > 1.5].any()
    assert max(gone_from(flown, row, 4.0) for row in range(4)) < 0.05


def test_a_hand_that_the_tracker_takes_for_a_drone_holds_and_nobody_is_touched() -> None:
    case = evolve(fail("glitch", 1, 2.0, 2.2), strokes=())
    _, formation = prepare(case.scenario, case.overrides)
    said = samples(case, tracked(case, poses(case, 60.0), formation))
    assert {sample.position for sample in said} == {REST}
    assert 11 <= sum(sample.jumped for sample in said) <= 14
    longer = judge(fly(fail("glitch", 1, 2.0, 6.0)), rules_of(case))
    assert not broken(longer)


@pytest.mark.parametrize("order", ["HOLD", "LAND"])
def test_the_operator_orders(order: str) -> None:
    wishes = (Wished(t=1.0, order="HOLD" if order == "HOLD" else "LAND"), Wished(t=2.0, order="FLY"))
    said = samples(evolve(CALM, wishes=wishes), poses(CALM, 60.0))
    assert [said[k].mode for k in (59, 60, 119, 120)] == [Wish.FLY, Wish(order), Wish(order), Wish.FLY]


def test_weather_loses_and_delays_and_draws_the_same_again() -> None:
    stormy = evolve(CALM, weather=Weather(loss=0.2, delay=0.05))
    calm, one, again = fly(CALM), fly(stormy), fly(stormy)
    assert np.array_equal(one.position, again.position)
    assert 0.001 < np.abs(one.position - calm.position).max() < 0.2
    assert not np.array_equal(fly(evolve(stormy, seed=1)).position, one.position)
    deaf = fly(evolve(CALM, weather=Weather(loss=1.0)))
    assert not deaf.hearing.any()


def test_a_kept_case_flies_again_and_its_hand_is_a_recording(tmp_path: Path) -> None:
    case = evolve(
        fail("cut", 2, 1.0, 2.0),
        strokes=(Stroke(to=(0.1, 0.3, 1.5), yaw=0.5, peak=0.9, rest=0.1),),
        wishes=(Wished(t=1.0, order="HOLD"),),
        weather=Weather(loss=0.1, delay=0.02),
    )
    save_case(case, tmp_path / "kept")
    assert load_case(tmp_path / "kept") == case == load_case(tmp_path / "kept" / "case.toml")
    said = samples(evolve(case, wishes=()), poses(case, 60.0))
    played = relayed(f"recording:{tmp_path / 'kept' / 'hand.csv'}?lead=0", 60.0, 60.0)
    gaps = [math.dist(a.position, b.position) for a, b in zip(played, said, strict=False)]
    assert max(gaps) < 1e-6
    assert len(said) - len(played) <= 2
    assert main(["sim", str(tmp_path / "kept" / "scenario.toml"), "--seconds", "0.1"]) == 0


def test_a_damaged_case_is_refused_with_its_key(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text('scenario="rhombus"\nseconds=1.0\nhand=[0,0,1]\nfaluts=[]\n')
    with pytest.raises(ConfigError, match="unknown key 'faluts'"):
        load_case(tmp_path)


def test_drawn_cases_are_within_what_was_planned() -> None:
    plan = Plan(scenarios=("rhombus", "grid", "maze"), vary=True)
    rng = np.random.default_rng(5)
    cases = [draw_case(plan, rng) for _ in range(80)]
    assert {case.scenario for case in cases} == {"rhombus", "grid", "maze"}
    assert {fault.kind for case in cases for fault in case.faults} >= {"cut", "kill", "held", "relay"}
    assert max(stroke.peak for case in cases for stroke in case.strokes) <= FASTEST_HAND
    calm = draw_case(Plan(scenarios=("rhombus",), faults=False, weather=False), rng)
    assert (calm.faults, calm.wishes, calm.weather) == ((), (), Weather())


@pytest.mark.parametrize("body", ["identified", "crazyflie"])
def test_what_drones_say_of_themselves_can_be_believed_whatever_happens_to_them(
    body: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[DroneState] = []
    publish = Air.publish

    def overheard(air: Air, message: Message, tick: int, agents: Sequence[Agent | None]) -> None:
        if isinstance(message, DroneState):
            said.append(message)
        publish(air, message, tick, agents)

    monkeypatch.setattr(Air, "publish", overheard)
    plan = Plan(scenarios=("rhombus",), overrides=(f"vehicles.all.body={body}",))
    case = draw_case(plan, np.random.default_rng(7))
    fly(case)
    limits = bodies_of(*prepare(case.scenario, case.overrides))
    for state in said:
        assert decode(encode(state), DroneState) == state
        check_possible(state.goal, state.goal_velocity, limits)
        assert state.ahead is not None
        assert state.pace is not None
        check_ahead(state.position, state.velocity, state.ahead, state.pace, state.asked, limits)
    assert len(said) > 1000


def test_a_case_is_changed_again_and_again_whatever_it_has_become() -> None:
    plan, rng = Plan(scenarios=("rhombus",)), np.random.default_rng(1)
    case = draw_case(plan, rng)
    seen = set()
    for _ in range(300):
        case = change(case, plan, rng)
        seen.add(len(case.faults))
    assert 0 in seen, "none are left at times"
    assert len(seen) > 1


def test_the_same_seed_finds_the_same_worst() -> None:
    plan = Plan(scenarios=("rhombus",), faults=False)
    budget = Budget(flights=6)
    one, again = search(plan, budget, 3, jobs=1), search(plan, budget, 3, jobs=1)
    assert one.flights == 6
    assert one.worst == again.worst
    assert search(plan, budget, 4, jobs=1).worst != one.worst


def test_the_finds_keep_the_worst_of_each_class() -> None:
    plan = Plan(scenarios=("rhombus",), faults=False, weather=False)
    seen: list[Finds] = []
    finds = search(plan, Budget(flights=6), 3, jobs=1, report=seen.append)
    assert seen[-1] == finds
    for kind, kept in finds.worst.items():
        margins = [find.margin(kind) for find in kept]
        assert margins == sorted(margins)
        assert all(try_case(find.case)[kind] == find.verdict[kind] for find in kept[:1])
    assert not finds.worst["column"]


def test_the_command_keeps_what_it_found_and_flies_it_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["falsify", "rhombus", "--flights", "2", "--jobs", "1", "--no-faults", "--keep", str(tmp_path)]
    code = main(command)
    found = capsys.readouterr().out
    worst = next(line for line in found.splitlines() if line.startswith("between two bodies"))
    assert f"swarmtouch falsify --case {tmp_path / 'rhombus-0' / 'drones'}" in found
    main(["falsify", "--case", str(tmp_path / "rhombus-0" / "drones")])
    again = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("between two bodies"))
    assert worst.split()[3] == again.split()[3]
    assert code == int(" 1/2 " in found or " 2/2 " in found)


def test_the_command_needs_a_scenario(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["falsify"]) == 2
    assert "--case" in capsys.readouterr().err
