"""The simulators: agents in lockstep, one central computer, and that they agree."""

import csv
import gc
import hashlib
import itertools
from pathlib import Path

import numpy as np
import pytest

from agents.control.safety.encounter import DELAY
from agents.settings import hand_settings
from agents.vehicles.world.setup import referee_rules
from deploy.lockstep.central import Flock, fly_central
from deploy.lockstep.collector import no_collector
from deploy.lockstep.flock import _reach
from deploy.lockstep.hand_track import map_samples, relayed
from deploy.lockstep.lockstep import Lockstep, fly_lockstep
from deploy.lockstep.record import Record, judge, write_csv
from deploy.lockstep.start import rest_places, start_flyers
from shared.config import load_scenario
from shared.formation import build_formation
from shared.messages import HandSample, Mode, Wish
from shared.scenario import Scenario
from tests.hands import RATE_HZ, REST, samples_of, still, stroke
from tests.runs import distances, fly_all

pytestmark = pytest.mark.slow

SLOW = 0.25
"""Peak speed at which nobody has to keep off anybody, m/s."""


def fly_both(scenario: Scenario, hand: list[HandSample]) -> tuple[Record, Record]:
    formation = build_formation(scenario)
    return fly_lockstep(scenario, formation, hand), fly_central(scenario, formation, hand)


@pytest.mark.parametrize("height_from", ["hand", "references"])
@pytest.mark.parametrize(
    ("shape", "law", "n"),
    [("rhombus", "paper", 4), ("rhombus", "stable", 4), ("vee", "stable", 6), ("grid", "stable", 18)],
)
def test_agents_and_one_central_computer_fly_the_same(shape: str, law: str, n: int, height_from: str) -> None:
    scenario = load_scenario(
        shape,
        [
            f"swarm.law={law}",
            f"formation.n={n}",
            f"formation.height_from={height_from}",
            "formation.spacing=0.8",
            "formation.width=0.8",
        ],
    )
    agents, central = fly_both(scenario, stroke(0.7, 0.4, SLOW, after=1.0))
    assert np.ptp(agents.position, axis=0).max() > 0.3
    for name in ("position", "goal", "setpoint", "displacement"):
        assert np.abs(getattr(agents, name) - getattr(central, name)).max() < 1e-9, name


def test_they_agree_when_the_formation_turns_with_the_hand() -> None:
    scenario = load_scenario("rhombus", ["formation.spacing=0.8", "formation.width=0.8"])
    turning = [
        HandSample(
            epoch=0,
            seq=k,
            stamp_ns=s.stamp_ns,
            position=s.position,
            velocity=s.velocity,
            yaw=0.2 * k / 60.0,
            mode=s.mode,
        )
        for k, s in enumerate(stroke(0.7, 0.4, SLOW, after=1.0))
    ]
    agents, central = fly_both(scenario, turning)
    assert agents.hand.yaw[-1] > 0.5
    assert np.abs(agents.position - central.position).max() < 1e-9


def test_the_same_inputs_give_the_same_bytes() -> None:
    scenario = load_scenario("rhombus")
    formation = build_formation(scenario)
    hand = stroke(np.pi, 0.5, 1.0, after=0.5)

    def digest() -> str:
        swarm = Lockstep(
            scenario,
            formation,
            start_flyers(scenario, formation, (REST + formation.rest).tolist(), airborne=True),
        )
        total = hashlib.sha256()
        for sample in hand:
            swarm.advance(sample)
            for key, payload in sorted(swarm.payloads.items()):
                total.update(key.encode() + payload)
        return total.hexdigest()

    assert digest() == digest()


@pytest.mark.parametrize("law", ["paper", "stable"])
def test_messages_fly_as_their_bytes_do(law: str) -> None:
    scenario = load_scenario("rhombus", [f"swarm.law={law}"])
    formation, hand = build_formation(scenario), stroke(np.pi, 0.5, 1.0, after=0.5)
    as_bytes, as_they_are = (
        fly_lockstep(scenario, formation, hand, airborne=False, encoded=encoded) for encoded in (True, False)
    )
    assert np.ptp(as_bytes.position[..., 2]) > 0.5
    for name in ("position", "goal", "setpoint", "displacement"):
        assert np.array_equal(getattr(as_bytes, name), getattr(as_they_are, name)), name


def test_it_takes_off_from_the_ground_follows_and_lands() -> None:
    scenario = load_scenario("rhombus")
    formation = build_formation(scenario)
    move = stroke(np.pi, 0.4, 0.3, before=8.0, after=2.0)
    wishes = itertools.chain(
        ((s.position, s.velocity, Wish.FLY) for s in move),
        ((move[-1].position, (0.0, 0.0, 0.0), Wish.LAND) for _ in range(480)),
    )
    swarm = Lockstep(
        scenario, formation, start_flyers(scenario, formation, (REST + formation.rest).tolist(), airborne=False)
    )
    seen: list[set[Mode]] = [set() for _ in formation.ids]
    for k, (position, velocity, wish) in enumerate(wishes):
        sample = HandSample(
            epoch=0,
            seq=k,
            stamp_ns=round(k * 1e9 / RATE_HZ),
            position=position,
            velocity=velocity,
            yaw=0.0,
            mode=wish,
        )
        states = swarm.advance(sample)
        for row, state in enumerate(states):
            seen[row].add(state.mode)
        if k == len(move) - 1:
            assert {state.mode for state in states} == {Mode.FOLLOW}
            assert max(np.linalg.norm(np.array(state.position) - state.goal) for state in states) < 0.15
    assert {state.mode for state in states} == {Mode.GROUND}
    assert [flyer.body.position[2] for flyer in swarm.flyers] == pytest.approx([0.0] * 4, abs=1e-6)
    assert all(modes >= {Mode.TAKEOFF, Mode.FOLLOW, Mode.LAND, Mode.GROUND} for modes in seen)


def test_a_held_drone_stays_and_the_others_keep_away() -> None:
    scenario = load_scenario("rhombus", ["fence.room=4.0"])
    record = fly_lockstep(scenario, build_formation(scenario), stroke(0.0, 1.0, 0.5, after=1.0), held={4})
    assert np.ptp(record.position[:, 3], axis=0).max() == 0.0
    assert np.ptp(record.position[:, 0], axis=0).max() > 0.5


def test_a_thousand_drones_keep_their_distances() -> None:
    scenario = load_scenario("grid", ["formation.n=1000", "fence.room=4.0"])
    hand = stroke(np.pi / 2, 0.6, 1.0, before=0.1, after=0.0)[:60]
    worst = distances(scenario, itertools.islice(fly_all(scenario, [hand]), 0, None, 10))
    assert worst.drones.min() >= 0.30
    assert worst.outside.max() < 0.0


def test_a_scripted_hand_is_relayed_tick_by_tick() -> None:
    samples = relayed("scripted:sweep?heading=0&stroke=0.5&peak=0.5&lead=0.5", 60.0, RATE_HZ)
    assert [s.seq for s in samples] == list(range(len(samples)))
    assert {s.mode for s in samples} == {Wish.FLY}, "it ends where the source ends"
    speed = max(s.velocity[0] for s in samples)
    assert speed == pytest.approx(0.5, abs=0.01)


def test_the_csv_has_one_documented_row_per_tick(tmp_path: Path) -> None:
    scenario = load_scenario("rhombus")
    hand = stroke(0.0, 0.3, 0.3, after=0.2)
    record = fly_lockstep(scenario, build_formation(scenario), hand)
    write_csv(record, tmp_path / "run.csv")
    with (tmp_path / "run.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(hand)
    tick = len(hand) // 2
    assert float(rows[tick]["t"]) == pytest.approx(tick / RATE_HZ)
    assert float(rows[tick]["hand_x"]) == pytest.approx(hand[tick].position[0])
    assert float(rows[tick]["p2_y"]) == pytest.approx(record.position[tick, 1, 1])
    assert float(rows[tick]["g4_x"]) == pytest.approx(record.goal[tick, 3, 0])
    assert float(rows[tick]["s1_z"]) == pytest.approx(record.setpoint[tick, 0, 2])
    assert float(rows[tick]["dhuman-1_x"]) == pytest.approx(record.displacement[tick, 0, 0])


def test_the_referee_judges_the_record() -> None:
    scenario = load_scenario("rhombus")
    formation = build_formation(scenario)
    record = fly_lockstep(scenario, formation, still(0.5))
    verdict = judge(record, referee_rules(scenario, formation, formation.ids))
    assert verdict["collisions"] == verdict["fence_exits"] == 0
    assert verdict["min_distance_m"] == pytest.approx(np.hypot(0.5, 0.5), abs=0.01)
    assert verdict["min_hand_distance_m"] == pytest.approx(0.5, abs=0.01)


def test_a_hand_that_wishes_hold_moves_nobody() -> None:
    scenario = load_scenario("rhombus")
    positions = np.tile(REST, (60, 1))
    positions[:, 0] += np.linspace(0.0, 0.5, 60)
    hand = samples_of(positions, np.tile([0.5, 0.0, 0.0], (60, 1)), Wish.HOLD)
    record = fly_lockstep(scenario, build_formation(scenario), hand)
    assert np.ptp(record.goal, axis=0).max() < 1e-6


def test_what_is_rounded_stays_small_in_a_formation_with_room() -> None:
    """One whose drones keep off each other all the time is chaotic instead (docs/performance.md)."""
    scenario = load_scenario("grid", ["formation.n=25"])
    formation = build_formation(scenario)
    hand = map_samples(stroke(np.pi / 3, 1.0, 0.9, after=1.0), hand_settings(scenario, formation))
    seen = []
    for moved in (0.0, 1e-13):
        (x, y, z), *others = rest_places(formation, hand[0][1])
        flock = Flock(scenario, formation, [(x + moved, y, z), *others])
        for sample, mapped in hand:
            flock.advance(sample, mapped)
        seen.append(np.array([member.setpoint for member in flock.members]))
    assert np.abs(seen[0] - seen[1]).max() < 1e-10


def test_a_flock_looks_no_further_than_its_drones_can_brake() -> None:
    scenario = load_scenario("grid", ["formation.n=25"])
    formation = build_formation(scenario)
    ((sample, mapped), *_) = map_samples(still(1), hand_settings(scenario, formation))
    flock = Flock(scenario, formation, rest_places(formation, mapped))
    flock.advance(sample, mapped)
    rules = flock.members[0].steering.safety
    wait = DELAY * flock.members[0].clearance.surprise
    stop = rules.planar.reach(wait, rules.horizontal.acceleration)
    assert _reach(flock.members, 0.0) == pytest.approx(flock.members[0].clearance.distance + stop, abs=0.01)
    assert _reach(flock.members, 5.0) > 5.0, "a reference that is far ahead is looked around as well"


def test_nothing_that_a_flock_makes_needs_a_collector() -> None:
    scenario = load_scenario("grid", ["formation.n=25"])
    formation = build_formation(scenario)
    hand = map_samples(stroke(np.pi / 3, 1.0, 0.9, after=1.0), hand_settings(scenario, formation))
    flock = Flock(scenario, formation, rest_places(formation, hand[0][1]))
    gc.collect()
    with no_collector():
        assert not gc.isenabled()
        for sample, mapped in hand:
            flock.advance(sample, mapped)
        assert gc.collect() == 0
    assert gc.isenabled()
