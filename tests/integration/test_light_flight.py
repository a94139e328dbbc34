"""What flies carries nothing that only preparing a flight needs."""

import sys
from pathlib import Path

import pytest

from deploy.launcher.process_table import ProcessRow
from shared.scenario_check.checked import SUFFIX
from tests.integration.swarm import Swarm

pytestmark = pytest.mark.parallel

SPY = Path(__file__).parents[1] / "loaded_modules.py"
FLYING = ("agents", "human_relay")
HEAVY = {"numpy", "scipy", "cattrs", "rich", "tomli_w", "mcap", "matplotlib", "cryptography"}
CHECKS = {"shared.config", "shared.scenario_check.check", "shared.scenario_check.room"}


class WatchedSwarm(Swarm):
    """Its agents and its relay say at their end what they had loaded."""

    def command(self, row: ProcessRow) -> tuple[str, ...]:
        python, *flags, dash_m, module = row.command[:4]
        assert (python, flags, dash_m) == (sys.executable, ["-P"], "-m")
        if module not in FLYING:
            return row.command
        return (python, "-P", str(SPY), str(self._folder), *row.command[3:])


@pytest.mark.timeout(90)
@pytest.mark.parametrize("checked", [True, False], ids=["by a launcher", "alone"])
def test_who_flies_has_loaded_only_what_flying_needs(checked: bool, tmp_path: Path) -> None:
    swarm = WatchedSwarm("line", "scripted:tour?lead=1", tmp_path, ["formation.n=1"])
    left = (tmp_path / "scenario.toml").with_suffix(SUFFIX)
    assert left.exists()
    if not checked:
        left.unlink()
    try:
        swarm.fly()
        swarm.recorder.listen(1.0)
        assert set(swarm.end().values()) == {0}
    finally:
        swarm.close()
    for module in FLYING:
        loaded = set((tmp_path / f"{module}.modules").read_text(encoding="utf-8").split())
        assert {"zenoh", "msgspec", "shared.formation"} <= loaded
        assert loaded & (HEAVY | CHECKS) == set()
