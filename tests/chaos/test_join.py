"""A member joins while a fifth of all packets is lost, each way, over QUIC with mutual TLS and access rules."""

import select
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
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

pytestmark = [pytest.mark.container, pytest.mark.timeout(700)]

ROOT = Path(__file__).resolve().parents[2]
TIMES = 20
LOSS = 0.2
LIMIT_S = 60.0


def test_a_node_joins_under_loss_every_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if reason := obstacle():
        pytest.skip(reason)
    with Lab([drone_node(STAYS), drone_node(JOINS)]) as lab:
        file = secured_scenario(lab, tmp_path)
        lab.lose(LOSS)
        with member(lab, file, STAYS):
            took = sorted(seconds_to_join(lab, file) for _ in range(TIMES))
    with capsys.disabled():
        print(f"\njoined {TIMES} times under loss: median {took[TIMES // 2]:.2f} s, longest {took[-1]:.2f} s")


def seconds_to_join(lab: Lab, file: str) -> float:
    """Lets one join, kills it, and returns how long it took."""
    with member(lab, file, JOINS) as joiner:
        assert joiner.stdout is not None
        assert select.select([joiner.stdout], [], [], LIMIT_S)[0], f"has not joined within {LIMIT_S} s"
        return float(joiner.stdout.readline())


@contextmanager
def member(lab: Lab, file: str, drone: int) -> Iterator["subprocess.Popen[str]"]:
    """Runs one of the two in its namespace."""
    command = (*lab.within(drone_node(drone)), sys.executable, "-m", "tests.chaos.joiner", file, str(drone))
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        try:
            yield process
        finally:
            process.kill()


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
