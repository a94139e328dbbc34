"""The one door to a scenario that is to fly: loaded, built, and checked as a whole."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from shared.config import load_scenario
from shared.errors import ConfigError
from shared.formation import Formation, build_formation
from shared.scenario import Scenario
from shared.scenario_check.effect import check_effect
from shared.scenario_check.finding import Finding
from shared.scenario_check.network import check_links, check_network, check_nodes
from shared.scenario_check.room import check_room
from shared.scenario_check.vehicles import check_vehicles


def check_scenario(scenario: Scenario, formation: Formation, *, network: bool = True) -> Iterator[Finding]:
    """Yields everything that does not go together.

    Args:
        scenario: The scenario.
        formation: Its formation.
        network: Whether it is to fly as processes; a simulator in one process has no links between them.
    """
    yield from check_room(scenario, formation)
    yield from check_vehicles(scenario, formation)
    yield from check_effect(scenario, formation)
    yield from check_nodes(scenario, formation)
    yield from check_links(scenario, formation)
    if network:
        yield from check_network(scenario, formation)


def open_scenario(
    source: str | Path, overrides: Sequence[str] = (), *, network: bool = True
) -> tuple[Scenario, Formation]:
    """Loads a scenario that is to fly.

    Args:
        source: Path of a TOML file, or the bare name of one that ships.
        overrides: `key=value` with dotted keys, as given to `--set`.
        network: As for `check_scenario`.

    Returns:
        The scenario and its formation.

    Raises:
        ConfigError: A reason per thing that is wrong: file, key, and what to do.
    """
    scenario = load_scenario(source, overrides)
    formation = build_formation(scenario, str(source))
    findings = list(check_scenario(scenario, formation, network=network))
    if findings:
        raise ConfigError(*(f"{source}: {finding}" for finding in findings))
    return scenario, formation
