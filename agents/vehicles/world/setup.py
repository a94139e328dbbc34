"""From a scenario to what a world consists of."""

from collections.abc import Mapping
from collections.abc import Set as AbstractSet

from attrs import frozen

from agents.vehicles.bodies.fleet import Fleet, park_fleet
from agents.vehicles.sim import parse_uri
from agents.vehicles.world.faults import Faults, faults_of
from agents.vehicles.world.referee import Rules
from shared.cylinders import columns_of
from shared.errors import ConfigError
from shared.fence import fence_box
from shared.formation import Formation, build_formation
from shared.messages import Vector
from shared.scenario import Scenario
from shared.vehicles import vehicle_settings


@frozen(eq=False)
class Setup:
    """The parts of a world.

    Attributes:
        formation: The whole formation, drones with other vehicles included.
        fleet: Every simulated drone, parked below its place in the rest formation at home.
        hovers: Drones that follow the link-loss rule `hover`.
        address: Host and port that their drivers expect.
        rules: What the referee counts.
        faults: What the scenario makes fail, by drone.
    """

    formation: Formation
    fleet: Fleet
    hovers: AbstractSet[int]
    address: tuple[str, int]
    rules: Rules
    faults: Mapping[int, Faults]


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
        [_place(scenario, formation, drone) for drone in simulated],
    )
    return Setup(
        formation=formation,
        fleet=fleet,
        hovers={drone for drone, s in simulated.items() if s.link_loss == "hover"},
        address=_address({drone: str(s.uri) for drone, s in simulated.items()}),
        rules=referee_rules(scenario, formation, tuple(fleet)),
        faults={drone: faults_of(s) for drone, s in simulated.items()},
    )


def referee_rules(scenario: Scenario, formation: Formation, ids: tuple[int, ...]) -> Rules:
    """Returns what the referee counts for some drones of a scenario."""
    return Rules(
        ids=ids,
        columns=columns_of(scenario),
        fence=fence_box(scenario, formation),
    )


def _place(scenario: Scenario, formation: Formation, drone: int) -> Vector:
    """Returns the place on the ground below a drone's in the rest formation at home, m."""
    (x, y, _), (home_x, home_y) = formation.rest[formation.row(drone)], scenario.hand.home
    return (x + home_x, y + home_y, 0.0)


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
