"""From a scenario to what a world consists of."""

import numpy as np
from attrs import frozen

from agents.vehicles.bodies.fleet import Fleet, park_fleet
from agents.vehicles.bodies.state import Mask, Vec
from agents.vehicles.sim import parse_uri
from agents.vehicles.world.faults import Faults, faults_of
from agents.vehicles.world.referee import Rules
from shared.config import vehicle_settings
from shared.errors import ConfigError
from shared.fence import fence_box
from shared.formation import Formation, build_formation
from shared.scenario import Scenario


@frozen(eq=False)
class Setup:
    """The parts of a world.

    Attributes:
        formation: The whole formation, drones with other vehicles included.
        fleet: Every simulated drone, parked below its place in the rest formation at home.
        hovers: (N,) rows that follow the link-loss rule `hover`.
        address: Host and port that their drivers expect.
        rules: What the referee counts.
        faults: What the scenario makes fail.
    """

    formation: Formation
    fleet: Fleet
    hovers: Mask
    address: tuple[str, int]
    rules: Rules
    faults: Faults


def plan_world(scenario: Scenario) -> Setup:
    """Plans the world of a scenario: its drones with a `sim://` vehicle.

    Raises:
        ConfigError: No simulated drone, worlds at two addresses, or a URI for another drone.
    """
    formation = build_formation(scenario)
    settings = {drone: vehicle_settings(scenario, drone) for drone in formation.ids}
    simulated = {drone: s for drone, s in settings.items() if str(s.uri).startswith("sim://")}
    fleet = park_fleet(
        {drone: str(s.body) for drone, s in simulated.items()},
        _places(scenario, formation)[[formation.row(drone) for drone in simulated]],
    )
    return Setup(
        formation=formation,
        fleet=fleet,
        hovers=np.array([s.link_loss == "hover" for s in simulated.values()], dtype=bool),
        address=_address({drone: str(s.uri) for drone, s in simulated.items()}),
        rules=referee_rules(scenario, formation, fleet.ids),
        faults=faults_of(list(simulated.values())),
    )


def referee_rules(scenario: Scenario, formation: Formation, ids: tuple[int, ...]) -> Rules:
    """Returns what the referee counts for some drones of a scenario."""
    return Rules(
        ids=ids,
        columns=np.array([(o.x, o.y) for o in scenario.obstacles], dtype=np.float64).reshape(-1, 2),
        column_radius=scenario.avoidance.columns.radius,
        fence=fence_box(scenario, formation),
    )


def _places(scenario: Scenario, formation: Formation) -> Vec:
    """(N, 3) places on the ground below the rest formation at home."""
    places = np.zeros_like(formation.rest)
    places[:, :2] = formation.rest[:, :2] + scenario.hand.home
    return places


def _address(uris: dict[int, str]) -> tuple[str, int]:
    addresses = set()
    for drone, uri in uris.items():
        host, port, named = parse_uri(uri)
        if named != drone:
            raise ConfigError(
                f"vehicles: drone {drone} has {uri!r}, which is drone {named}; end it with /{{id}}"
            )
        addresses.add((host, port))
    if len(addresses) != 1:
        raise ConfigError(
            f"vehicles: a world serves one sim:// address, this scenario has {sorted(addresses) or 'none'}"
        )
    return addresses.pop()
