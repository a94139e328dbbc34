"""The process table and the resolved scenario."""

import sys
from collections.abc import Callable
from pathlib import Path

import attrs
import pytest

from deploy.launcher.ports import free_ports
from deploy.launcher.process_table import ProcessRow, hint_overrides, process_table, resolve_scenario
from deploy.launcher.run_directory import create_run_directory
from shared.config import dump_scenario, load_scenario, structure_scenario
from shared.errors import ConfigError
from shared.formation import build_formation
from shared.nodes import all_nodes, dials, endpoint
from shared.scenario import Scenario
from shared.vehicles import vehicle_settings

RHOMBUS = load_scenario("rhombus")
FORMATION = build_formation(RHOMBUS)
PORTS = list(range(9001, 9001 + len(all_nodes(FORMATION))))


def rows_of(scenario: Scenario, *, record: bool = False, verbose: bool = False) -> tuple[ProcessRow, ...]:
    return process_table(
        scenario,
        build_formation(scenario),
        file=Path("/runs/1/scenario.toml"),
        hand="scripted:tour",
        run_dir=Path("/runs/1"),
        record=record,
        verbose=verbose,
    )


def test_one_row_per_process_and_the_relay_is_last() -> None:
    rows = rows_of(RHOMBUS)
    assert [row.token for row in rows] == ["world/0", "drone/1", "drone/2", "drone/3", "drone/4", "relay/0"]
    assert [row.name for row in rows] == ["world", "drone-1", "drone-2", "drone-3", "drone-4", "relay"]
    assert [row.takes_orders for row in rows] == [False] * 5 + [True]
    assert all(row.restarts for row in rows)


def test_command_lines() -> None:
    rows = {row.name: row.command for row in rows_of(RHOMBUS)}
    python = (sys.executable, "-P", "-m")
    scenario = ("--scenario", "/runs/1/scenario.toml")
    assert rows["drone-2"] == (*python, "agents", *scenario, "--id", "2")
    assert rows["relay"] == (*python, "human_relay", *scenario, "--hand", "scripted:tour")
    assert rows["world"] == (*python, "agents.vehicles.world", *scenario, "--run-dir", "/runs/1")
    assert all("-v" in row.command for row in rows_of(RHOMBUS, verbose=True))


def test_a_recorder_hears_it_all_from_the_start() -> None:
    recorder, *others = rows_of(RHOMBUS, record=True)
    assert recorder.name == "observer"
    assert others == list(rows_of(RHOMBUS))
    assert recorder.restarts
    assert recorder.command[3:] == ("observer", "--scenario", "/runs/1/scenario.toml", "--run-dir", "/runs/1")


def test_without_simulated_vehicles_there_is_no_world() -> None:
    real = attrs.evolve(
        RHOMBUS,
        vehicles=attrs.evolve(RHOMBUS.vehicles, all=attrs.evolve(RHOMBUS.vehicles.all, uri="radio://0/{id}")),
    )
    assert "world/0" not in [row.token for row in rows_of(real)]


def test_the_resolved_scenario_gives_every_node_its_own_port_and_survives_the_file(tmp_path: Path) -> None:
    resolved = resolve_scenario(RHOMBUS, FORMATION, PORTS, 9999)
    endpoints = [endpoint(resolved, FORMATION, node) for node in all_nodes(FORMATION)]
    assert endpoints == [f"tcp/127.0.0.1:{port}" for port in PORTS]
    assert set(dials(resolved, FORMATION, "drone/2")) == {endpoints[0], endpoints[1]}
    assert vehicle_settings(resolved, 3).uri == "sim://127.0.0.1:9999/3"
    file = tmp_path / "scenario.toml"
    file.write_text(dump_scenario(resolved))
    assert load_scenario(file) == resolved


def test_addresses_that_the_scenario_names_stay() -> None:
    tree = {
        "net": {"endpoints": {"relay": "tcp/10.0.0.1:7447"}},
        "vehicles": {"all": {"uri": "sim://127.0.0.1:1234/{id}"}, "robots": {"2": {"uri": "sim://h:1/2"}}},
    }
    named = structure_scenario(tree, "test")
    resolved = resolve_scenario(named, build_formation(named), PORTS, 9999)
    assert resolved.net.endpoints["relay"] == "tcp/10.0.0.1:7447"
    assert resolved.net.endpoints["drone/1"] == "tcp/127.0.0.1:9002"
    assert vehicle_settings(resolved, 1).uri == "sim://127.0.0.1:1234/1"
    assert vehicle_settings(resolved, 2).uri == "sim://h:1/2"


def test_hints_become_overrides_that_the_user_can_override() -> None:
    hints = {
        "hand.mapping": "relative",
        "hand.gain": 2.0,
        "hand.offset": [0.5, -1.0, 0.0],
        "obstacles": [{"name": 'c "1"', "x": 1.0, "y": -2.0}],
    }
    scenario = load_scenario("rhombus", [*hint_overrides(hints), "hand.gain=3.0"])
    assert scenario.hand.mapping == "relative"
    assert scenario.hand.offset == (0.5, -1.0, 0.0)
    assert scenario.hand.gain == 3.0
    assert [(o.name, o.x, o.y) for o in scenario.obstacles] == [('c "1"', 1.0, -2.0)]


@pytest.mark.parametrize("count", [1, 100])
def test_free_ports_differ(count: int) -> None:
    tcp, udp = free_ports(tcp=count, udp=count)
    assert len(set(tcp)) == len(set(udp)) == count
    assert all(port > 1024 for port in tcp + udp)


def test_run_directories_never_collide_and_latest_points_at_the_newest(tmp_path: Path) -> None:
    said: list[str] = []
    first, second = (create_run_directory(tmp_path / "runs", said.append) for _ in range(2))
    assert first != second
    assert (first / "logs").is_dir()
    assert (tmp_path / "runs" / "latest").resolve() == second
    assert said == []


def a_file(runs: Path) -> None:
    runs.write_text("no folder")


def a_loop_of_links(runs: Path) -> None:
    runs.symlink_to(runs)


def a_link_to_nowhere_that_can_be(runs: Path) -> None:
    runs.symlink_to("/dev/null/runs")


def too_long_a_name(runs: Path) -> None:
    runs.parent.rmdir()
    runs.parent.symlink_to("x" * 300)


@pytest.mark.parametrize("make", [a_file, a_loop_of_links, a_link_to_nowhere_that_can_be, too_long_a_name])
def test_a_strange_place_for_runs_is_refused_by_name(make: Callable[[Path], None], tmp_path: Path) -> None:
    runs = tmp_path / "here" / "runs"
    runs.parent.mkdir()
    make(runs)
    with pytest.raises(ConfigError, match=f"{runs}: no directory can be made there"):
        create_run_directory(runs, print)


def test_a_folder_called_latest_stays_and_the_run_begins(tmp_path: Path) -> None:
    said: list[str] = []
    (tmp_path / "latest" / "mine").mkdir(parents=True)
    run = create_run_directory(tmp_path, said.append)
    assert (run / "logs").is_dir()
    assert f"name it to other commands: {run}" in said[0]
    assert {path.name for path in tmp_path.iterdir()} == {"latest", run.name}
