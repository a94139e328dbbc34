"""A member joins while a fifth of all packets is lost, each way, over QUIC with mutual TLS and access rules."""

import subprocess
import sys
from pathlib import Path

import attrs
import pytest

from deploy.net.authority import create, issue
from shared.config import dump_scenario, load_scenario
from shared.formation import build_formation
from shared.net.keyring import Keyring
from shared.nodes import all_nodes, drone_node
from shared.scenario import Net
from tests.chaos.joiner import JOINS, STAYS
from tests.chaos.lab import Lab, obstacle

pytestmark = [pytest.mark.container, pytest.mark.timeout(400)]

ROOT = Path(__file__).resolve().parents[2]
TIMES = 20
LOSS = 0.2


def test_a_node_joins_under_loss_every_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if reason := obstacle():
        pytest.skip(reason)
    with Lab([drone_node(STAYS), drone_node(JOINS)]) as lab:
        file = secured_scenario(lab, tmp_path)
        lab.lose(LOSS)
        stays = member(lab, file, STAYS)
        with subprocess.Popen(stays, stdout=subprocess.PIPE, text=True, cwd=ROOT) as anchor:
            try:
                assert anchor.stdout is not None
                assert anchor.stdout.readline() == "ready\n"
                joins = (*member(lab, file, JOINS), str(TIMES))
                done = subprocess.run(joins, check=True, capture_output=True, text=True, cwd=ROOT)
            finally:
                anchor.kill()
    lines = done.stdout.split()
    assert len(lines) == TIMES
    assert "None" not in lines
    took = sorted(float(line) for line in lines)
    with capsys.disabled():
        print(
            f"\njoined {TIMES} times under loss: {took[TIMES // 2]:.2f} s (median), {took[-1]:.2f} s (longest)"
        )


def secured_scenario(lab: Lab, folder: Path) -> str:
    """Writes a scenario of the profile `field` in the mesh, with keys for everybody in it."""
    raw = load_scenario("rhombus")
    keyring = Keyring(folder / "keys")
    create(keyring, raw.swarm.name)
    members = [drone_node(STAYS), drone_node(JOINS)]
    for node in all_nodes(build_formation(raw)):
        issue(keyring, node, [lab.mesh(node)] if node in members else [])
    endpoints = {node: f"quic/{lab.mesh(node)}:7447?mixed_rel=1" for node in members}
    net = Net(profile="field", keys=str(keyring.folder), endpoints=endpoints)
    file = folder / "scenario.toml"
    file.write_text(dump_scenario(attrs.evolve(raw, net=net)), encoding="utf-8")
    return str(file)


def member(lab: Lab, file: str, drone: int) -> tuple[str, ...]:
    """Returns the command that runs one of the two in its namespace."""
    return (*lab.within(drone_node(drone)), sys.executable, "-m", "tests.chaos.joiner", file, str(drone))
