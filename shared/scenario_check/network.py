"""Whether the processes of a scenario can reach each other, and what they say can be sent."""

import math
from collections import Counter
from collections.abc import Iterator

from shared.codec import MAX_PAYLOAD, encode
from shared.formation import Formation, Link
from shared.messages import MAX_POSITION, MOST_LOST, DroneState, Heard, Mode, Seen, Vector
from shared.nodes import all_nodes, drone_node
from shared.scenario import Scenario
from shared.scenario_check.finding import Finding
from shared.topics import DRONE_STATE, HAND
from shared.validators import MAX_PORT
from shared.vehicles import vehicle_settings

_LARGEST_NUMBER = 2**64 - 1
_FAR: Vector = (-MAX_POSITION / 3.0,) * 3


def check_network(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    """Yields what cannot be reached, or not be said."""
    yield from _ports(scenario, formation)
    yield from _vehicles(scenario, formation)
    yield from _states(formation)


def check_nodes(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    """Yields the nodes that a scenario names and this swarm does not have."""
    known = (*all_nodes(formation), *map(drone_node, scenario.formation.absent))
    for node in scenario.net.endpoints:
        if node not in known:
            yield Finding(
                f'net.endpoints."{node}"', "this swarm has no such node", f"its nodes are {', '.join(known)}"
            )


def check_links(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    """Yields the impedance links whose displacement no receiver would accept."""
    for link in formation.links:
        largest = largest_displacement(link, scenario.hand.max_speed)
        if largest > MAX_POSITION:
            yield Finding(
                "impedance",
                f"link {link.name!r} gives way by up to {largest:.4g} m, states may say {MAX_POSITION:g} m at"
                " most: nobody would accept them",
                "raise stiffness or damping, or lower gain",
            )


def largest_displacement(link: Link, speed: float) -> float:
    """Returns how far a link gives way at most, whatever the hand does, m.

    The bound is `Kv v` times the integral of the absolute impulse response: `1 / K` with poles on the real
    axis, `coth(pi zeta / (2 sqrt(1 - zeta^2))) / K` for an underdamped link, without end for an undamped one.

    Args:
        link: The link.
        speed: Largest speed of the mapped hand, m/s.
    """
    if link.gain == 0.0:
        return 0.0
    zeta = link.damping / (2.0 * math.sqrt(link.mass * link.stiffness))
    static = abs(link.gain) * speed / link.stiffness
    if zeta >= 1.0:
        return static
    decay = math.pi * zeta / (2.0 * math.sqrt(1.0 - zeta * zeta))
    return static / math.tanh(decay) if decay > 0.0 else math.inf


def _ports(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    nodes = all_nodes(formation)
    if scenario.net.base_port + len(nodes) > MAX_PORT + 1:
        yield Finding(
            "net.base_port",
            f"{scenario.net.base_port} leaves no ports for {len(nodes)} nodes",
            f"{MAX_PORT + 1 - len(nodes)} is the last that does",
        )


def _vehicles(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    uris = {drone: str(vehicle_settings(scenario, drone).uri) for drone in formation.ids}
    for uri, times in Counter(uris.values()).items():
        if times > 1:
            drones = [drone for drone, own in uris.items() if own == uri]
            yield Finding(
                "vehicles",
                f"drones {', '.join(map(str, drones))} would fly one vehicle, {uri}",
                "write {id} where the number of the drone belongs",
            )


def _states(formation: Formation) -> Iterator[Finding]:
    """Looks whether the longest state of every drone can be sent: that of one that has lost the others."""
    for drone in formation.ids:
        size = len(encode(_longest_state(formation, drone)))
        if size > MAX_PAYLOAD:
            yield Finding(
                "formation",
                f"drone {drone} has {len(formation.ancestors(drone))} drones before it and"
                f" {len(formation.links_into(drone))} links: what it says may grow to {size} bytes, everybody"
                f" drops more than {MAX_PAYLOAD}",
                "make the formation flatter or smaller, or fly it with swarmtouch sim",
            )
            return


def _longest_state(formation: Formation, drone: int) -> DroneState:
    heard = Heard(*[_LARGEST_NUMBER] * 3)
    keys = [HAND.key(), *(DRONE_STATE.key(id=other) for other in formation.ancestors(drone))]
    others = tuple(other for other in formation.ids if other != drone)
    lost = Seen(max(formation.ids), _LARGEST_NUMBER, _LARGEST_NUMBER, _FAR, _FAR, Mode.TAKEOFF, 1.0 / 3.0)
    return DroneState(
        epoch=_LARGEST_NUMBER,
        seq=_LARGEST_NUMBER,
        stamp_ns=_LARGEST_NUMBER,
        id=drone,
        position=_FAR,
        velocity=_FAR,
        goal=_FAR,
        goal_velocity=_FAR,
        setpoint=_FAR,
        mode=Mode.TAKEOFF,
        displacements={link.name: _FAR for link in formation.links_into(drone)},
        heard=dict.fromkeys(keys, heard),
        unheard=others,
        lost=(lost,) * min(len(others), MOST_LOST),
        step_ns=_LARGEST_NUMBER,
    )
