"""How an observer finds a swarm and listens to all of it; it dials every node and nobody dials it."""

from collections.abc import Sequence
from pathlib import Path

from shared.bus import join
from shared.config import load_scenario
from shared.errors import ConfigError
from shared.formation import build_formation
from shared.nodes import OBSERVER
from shared.scenario import Scenario
from shared.transport import Bus

RUNS = Path("runs")
"""Where the launcher keeps flights."""
LATEST = "latest"
"""Its link to the newest one."""
SCENARIO_FILE = "scenario.toml"
"""The resolved scenario inside a run."""


def open_observer(scenario: Scenario) -> Bus:
    """Opens a bus to every node of a swarm, the launcher included; any number of observers may do so at once.

    Args:
        scenario: The resolved scenario: `net.endpoints` says where the nodes are.
    """
    return join(scenario, build_formation(scenario), OBSERVER, listening=False)


def running_scenario(source: str | None = None, overrides: Sequence[str] = (), runs: Path = RUNS) -> Scenario:
    """Loads the scenario of the swarm to observe.

    Args:
        source: A run directory, a scenario file or a scenario's name; None for the newest flight in `runs`.
        overrides: `key=value` items, for example the endpoints of processes that were started by hand.
        runs: Where flights are kept.

    Raises:
        ConfigError: There is no such scenario, or no flight yet.
    """
    if source is None:
        source = str(runs / LATEST)
        if not Path(source).exists():
            raise ConfigError(f"{source}: no flight yet; start one with swarmtouch up, or name a run directory")
    folder = Path(source)
    return load_scenario(str(folder / SCENARIO_FILE) if folder.is_dir() else source, overrides)
