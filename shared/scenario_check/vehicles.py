"""Whether the vehicles can keep their distances in the shape that they are to fly."""

import math
from collections.abc import Iterator

from shared.cells import near_pairs
from shared.envelope import Envelope, envelope_name, envelope_of
from shared.errors import ConfigError
from shared.formation import Formation
from shared.scenario import Scenario
from shared.scenario_check.finding import ROUNDING, Finding


def check_vehicles(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    """Yields the pair whose vehicles have to keep farther apart than it rests (docs/safety.md), if any."""
    try:
        envelopes = {drone: envelope_of(scenario, drone) for drone in formation.ids}
    except ConfigError as error:
        yield Finding("vehicles", str(error), "mend the file, or name one that ships in `envelope`")
        return
    known = {id(envelope): envelope for envelope in envelopes.values()}.values()
    reach = max(one.clearance(other) for one in known for other in known)
    points = [(x, y) for x, y, _ in formation.rest]
    lacks = [(_lack(formation, envelopes, one, other), one, other) for one, other in near_pairs(points, reach)]
    lack, one, other = max(lacks, default=(0.0, 0, 0))
    if lack > ROUNDING:
        first, second = formation.ids[one], formation.ids[other]
        needed = envelopes[first].clearance(envelopes[second])
        yield Finding(
            "formation",
            f"drones {first} and {second} rest {needed - lack:.3f} m apart, seen from above; their vehicles"
            f" ({envelope_name(scenario, first)}, {envelope_name(scenario, second)}) keep {needed:.3f} m",
            f"move them {lack:.3f} m farther apart, or fly vehicles with a smaller envelope",
        )


def _lack(formation: Formation, envelopes: dict[int, Envelope], one: int, other: int) -> float:
    """Returns by how much two drones rest too near to each other, m; who flies high enough above may."""
    first, second = envelopes[formation.ids[one]], envelopes[formation.ids[other]]
    (x, y, z), (a, b, c) = formation.rest[one], formation.rest[other]
    if abs(z - c) >= max(first.downwash.height, second.downwash.height):
        return 0.0
    return first.clearance(second) - math.hypot(x - a, y - b)
