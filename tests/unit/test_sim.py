"""`swarmtouch sim`: the simulators agree, are deterministic, and leave what was asked for."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

from agents.control.avoidance import HAND_BUBBLE
from deploy.cli import main
from deploy.lockstep.batched import fly_batched
from deploy.lockstep.lockstep import Lockstep, fly_lockstep
from deploy.lockstep.start import start_fleet
from shared.clock import NS_PER_S
from shared.config import load_scenario
from shared.formation import build_formation
from shared.messages import Mode, Wish
from tests.hands import REST, still, stroke

HAND = "scripted:sweep?stroke=0.5&peak=0.4&lead=0.2"


@pytest.mark.parametrize("law", ["paper", "stable"])
def test_agents_and_one_central_computer_fly_the_same_path(law: str) -> None:
    scenario = load_scenario("rhombus", [f'swarm.law="{law}"'])
    formation = build_formation(scenario)
    samples = stroke(0.3, 0.6, 0.3, after=1.0)
    decentral, central = fly_lockstep(scenario, formation, samples), fly_batched(scenario, formation, samples)
    apart = np.linalg.norm(decentral.position[:, 0] - decentral.hand.position, axis=1).min()
    assert apart > HAND_BUBBLE.radius, "nobody had to keep off anybody"
    assert np.abs(decentral.goal - central.goal).max() < 1e-9
    assert np.abs(decentral.position - central.position).max() < 1e-9


def test_the_same_inputs_give_the_same_bytes() -> None:
    scenario = load_scenario("rhombus")
    formation = build_formation(scenario)

    def last_payloads() -> dict[str, bytes]:
        places = REST + formation.rest
        swarm = Lockstep(scenario, formation, start_fleet(scenario, formation, places, airborne=True))
        for sample in stroke(1.0, 0.5, 0.5, after=0.0)[:60]:
            swarm.advance(sample)
        return swarm.payloads

    first = last_payloads()
    assert set(first) == {"human/hand", *(f"drone/{i}/state" for i in formation.ids)}
    assert first == last_payloads()


def test_a_swarm_takes_off_follows_and_lands() -> None:
    scenario = load_scenario("rhombus")
    formation = build_formation(scenario)
    swarm = Lockstep(
        scenario, formation, start_fleet(scenario, formation, REST + formation.rest, airborne=False)
    )
    landing = [
        evolve(s, seq=s.seq + 300, stamp_ns=s.stamp_ns + 5 * NS_PER_S) for s in still(6.0, wish=Wish.LAND)
    ]
    modes = [{state.mode for state in swarm.advance(sample)} for sample in (*still(5.0), *landing)]
    assert modes[0] == {Mode.TAKEOFF}
    assert modes[299] == {Mode.FOLLOW}
    assert modes[-1] == {Mode.GROUND}
    assert swarm.fleet.position[:, 2] == pytest.approx(0.0, abs=0.05)


def test_the_command_writes_csv_plot_and_summary(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, plot = tmp_path / "flight.csv", tmp_path / "flight.svg"
    command = ["sim", "rhombus", "--hand", HAND, "--seconds", "1", "--csv", str(table), "--plot", str(plot)]
    assert main([*command, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert summary["drones"] == 4
    assert summary["collisions"] == 0
    assert summary["realtime_factor"] > 0
    with table.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == round(summary["seconds"] * 60)
    assert float(rows[0]["p4_x"]) == pytest.approx(-1.5)
    assert {"hand_x", "mapped_x", "g1_y", "s2_z", "d2-4_x"} <= set(rows[0])
    assert plot.read_text(encoding="utf-8").count("drone") >= 4


def test_central_flies_many_drones(capsys: pytest.CaptureFixture[str]) -> None:
    command = [
        "sim",
        "grid",
        "--set",
        "formation.n=400",
        "--law",
        "central",
        "--hand",
        HAND,
        "--seconds",
        "0.5",
    ]
    assert main([*command, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert summary["drones"] == 400
    assert summary["min_distance_m"] > 0.3


def test_a_picture_in_an_unknown_format_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["sim", "rhombus", "--hand", HAND, "--seconds", "0.2", "--plot", str(tmp_path / "flight.xyz")]
    assert main(command) == 2
    assert "flight.xyz" in capsys.readouterr().err
