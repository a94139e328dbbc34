"""The process table of the floor: a bare node in the place of every agent and of the hand."""

import sys
from collections.abc import Mapping, Sequence

from deploy.bench.hop import HAND_ID
from deploy.launcher.process_table import ProcessRow
from shared.formation import Formation
from shared.nodes import DRONE, RELAY, dials, drone_node, endpoint, neighbours
from shared.scenario import Scenario
from shared.topics import DRONE_STATE, HAND


def zenoh_rows(scenario: Scenario, formation: Formation, sizes: Mapping[int, int]) -> list[ProcessRow]:
    """Derives bare nodes that have the links of the agents, hear the same keys and wait for the same nodes.

    Args:
        scenario: The resolved scenario: endpoints, rate of the hand.
        formation: Who refers to whom.
        sizes: Bytes of every node's payload, 0 for the hand.
    """

    def row(node: int) -> ProcessRow:
        name = RELAY if node == HAND_ID else drone_node(node)
        heard = [] if node == HAND_ID else [HAND.key(), *_state_keys(scenario, formation, node)]
        return _row(
            "deploy.bench.floor_zenoh",
            node,
            *_common(scenario, formation, sizes, node),
            *("--swarm", scenario.swarm.name, "--listen", endpoint(scenario, formation, name)),
            *_each("--connect", dials(scenario, formation, name)),
            *_each("--hear", heard),
        )

    return [row(node) for node in (*formation.ids, HAND_ID)]


def udp_rows(
    scenario: Scenario, formation: Formation, sizes: Mapping[int, int], ports: Sequence[int], observer: int
) -> list[ProcessRow]:
    """Derives bare nodes that send a datagram to everyone who would hear the agent.

    Args:
        scenario: Rate of the hand.
        formation: Who refers to whom.
        sizes: Bytes of every node's payload, 0 for the hand.
        ports: A free port per node: the hand's, then the drones'.
        observer: Port of the observer.
    """
    port = dict(zip((HAND_ID, *formation.ids), ports, strict=True))
    hearing = {drone: neighbours(scenario, formation, drone) for drone in formation.ids}

    def row(node: int) -> ProcessRow:
        listeners = [port[drone] for drone, heard in hearing.items() if node == HAND_ID or node in heard]
        return _row(
            "deploy.bench.floor_udp",
            node,
            *_common(scenario, formation, sizes, node),
            *("--port", str(port[node])),
            *_each("--to", [*listeners, observer]),
        )

    return [row(node) for node in (*formation.ids, HAND_ID)]


def _common(scenario: Scenario, formation: Formation, sizes: Mapping[int, int], node: int) -> tuple[str, ...]:
    references: list[int] = []
    if node != HAND_ID:
        references += formation.references(node)
        references += [HAND_ID] if formation.refers_to_human(node) else []
    return (
        *("--node", str(node), "--bytes", str(sizes[node]), "--hz", str(scenario.rates.hand_hz)),
        *_each("--reference", references),
    )


def _state_keys(scenario: Scenario, formation: Formation, drone: int) -> list[str]:
    return [DRONE_STATE.key(id=other) for other in neighbours(scenario, formation, drone)]


def _each(option: str, values: Sequence[object]) -> list[str]:
    return [word for value in values for word in (option, str(value))]


def _row(module: str, node: int, *arguments: str) -> ProcessRow:
    return ProcessRow(
        role=RELAY if node == HAND_ID else DRONE,
        number=node,
        command=(sys.executable, "-P", "-m", module, *arguments),
    )
