"""Who dials whom: every node of a swarm, its endpoint, and the static links between them (DESIGN section 3).

Order matters: of two nodes that need each other the later one in `all_nodes` dials, so no pair links twice.
"""

import math
from collections.abc import Collection

from shared.formation import Formation
from shared.scenario import Net, Scenario

RELAY = "relay"
DRONE = "drone"
WORLD = "world"
BRIDGE = "bridge"
OBSERVER = "observer"
CONSOLE = "console"

LOOPBACK = "127.0.0.1"

MOST_OTHERS = 32
"""Processes that are listened to beyond those that a swarm has."""

NEAR = 1.5
"""Drones that rest within this distance link to each other, m."""


def drone_node(drone: int) -> str:
    """Returns the node name of a drone."""
    return f"{DRONE}/{drone}"


def all_nodes(formation: Formation) -> tuple[str, ...]:
    """Returns every node of the swarm in dialling order."""
    return (RELAY, *(drone_node(i) for i in formation.ids), WORLD, BRIDGE, OBSERVER)


def processes(formation: Formation) -> frozenset[str]:
    """Returns the processes that a swarm may have, as `role/number`."""
    single = (f"{role}/0" for role in (RELAY, WORLD, BRIDGE, OBSERVER, CONSOLE))
    return frozenset((*single, *map(drone_node, formation.ids)))


def admits(expected: Collection[str], known: Collection[str], token: str) -> bool:
    """Says whether to remember a process: anybody may make up many, and each would stay for ever.

    Args:
        expected: Those that the swarm may have, who always are.
        known: Those that are remembered.
        token: Who it is, as `role/number`.
    """
    return token in expected or token in known or len(known) < len(expected) + MOST_OTHERS


def endpoint(scenario: Scenario, formation: Formation, node: str) -> str:
    """Returns the endpoint that a node listens on, empty for a client of a router.

    It is the scenario's `net.endpoints` entry, or else what `net.endpoint` makes of the node's name, or else a
    port on loopback counted from `net.base_port`.
    """
    net = scenario.net
    if net.router is not None:
        return ""
    pattern = net.endpoint or ("tcp/{node}:7447" if net.profile == "compose" else None)
    default = pattern or loopback(net, net.base_port + all_nodes(formation).index(node))
    return net.endpoints.get(node, default.replace("{node}", node.replace("/", "-")))


def loopback(net: Net, port: int) -> str:
    """Returns the endpoint of a port on this machine: QUIC where there are keys, else TCP."""
    return f"quic/{LOOPBACK}:{port}?mixed_rel=1" if net.keys else f"tcp/{LOOPBACK}:{port}"


def dials(scenario: Scenario, formation: Formation, node: str) -> list[str]:
    """Returns the endpoints that a node dials."""
    if scenario.net.router is not None:
        return [scenario.net.router]
    nodes = all_nodes(formation)
    earlier = nodes[: nodes.index(node)]
    # On a radio the relay has no link to dial; its samples are in the air.
    absent = {RELAY} if scenario.net.profile == "radio" else set()
    linked = [other for other in earlier if other not in absent and _linked(scenario, formation, node, other)]
    return [endpoint(scenario, formation, other) for other in linked]


def neighbours(scenario: Scenario, formation: Formation, drone: int) -> tuple[int, ...]:
    """Returns the drones that one hears: all of a small swarm, else its ancestors and those near it."""
    if len(formation.ids) <= scenario.net.full_mesh:
        return tuple(other for other in formation.ids if other != drone)
    return tuple(sorted((_resting_near(formation, drone) | set(formation.ancestors(drone))) - {drone}))


def tellers(scenario: Scenario, formation: Formation, drone: int) -> tuple[int, ...]:
    """Returns the drones that tell one where others are; none where everybody hears everybody.

    It is its references, those who refer to it and those that rest near it; those who refer to nobody but the
    human make a chain. So the word of anybody goes round to everybody.
    """
    if len(formation.ids) <= scenario.net.full_mesh:
        return ()
    found = _resting_near(formation, drone) | set(formation.references(drone))
    found.update(other for other in formation.ids if drone in formation.references(other))
    first = [other for other in formation.ids if not formation.references(other)]
    if drone in first:
        at = first.index(drone)
        found.update(first[max(at - 1, 0) : at + 2])
    return tuple(sorted(found - {drone}))


def _resting_near(formation: Formation, drone: int) -> set[int]:
    own = formation.rest[formation.row(drone)]
    pairs = zip(formation.ids, formation.rest, strict=True)
    return {other for other, place in pairs if math.dist(own, place) <= NEAR}


def _linked(scenario: Scenario, formation: Formation, node: str, earlier: str) -> bool:
    if WORLD in (node, earlier):
        # The world stands for physics, not for a member: it hears the hand (as the referee) and is observed.
        # Where somebody walks in it, it says so to everybody.
        heard = bool(scenario.walkers) and BRIDGE not in (node, earlier)
        return heard or RELAY in (node, earlier) or OBSERVER in (node, earlier)
    if not (node.startswith("drone/") and earlier.startswith("drone/")):
        return True
    one, other = int(node.removeprefix("drone/")), int(earlier.removeprefix("drone/"))
    heard = other in neighbours(scenario, formation, one) or one in neighbours(scenario, formation, other)
    return heard or other in tellers(scenario, formation, one)
