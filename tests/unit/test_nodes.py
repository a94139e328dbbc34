"""Who dials whom: every pair that must talk is linked exactly once."""

import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shared.config import load_scenario, structure_scenario
from shared.formation import Formation, build_formation
from shared.nodes import (
    BRIDGE,
    NEAR,
    OBSERVER,
    RELAY,
    WORLD,
    all_nodes,
    dials,
    drone_node,
    endpoint,
    neighbours,
    tellers,
)
from shared.scenario import Scenario

Swarm = tuple[Scenario, Formation]

FULL_MESH = Scenario().net.full_mesh


def swarm_of(shape: str, n: int, **settings: object) -> Swarm:
    scenario = structure_scenario({"formation": {"shape": shape, "n": n, **settings}}, "here")
    return scenario, build_formation(scenario)


def links(swarm: Swarm) -> list[frozenset[str]]:
    """Every link, as often as it is dialled."""
    scenario, formation = swarm
    node_at = {endpoint(scenario, formation, node): node for node in all_nodes(formation)}
    return [
        frozenset((node, node_at[dialled]))
        for node in all_nodes(formation)
        for dialled in dials(scenario, formation, node)
    ]


SWARMS = st.builds(swarm_of, st.sampled_from(["line", "vee", "grid", "rhombus"]), st.integers(1, 40))


@given(swarm=SWARMS)
@settings(max_examples=30)
def test_no_pair_links_twice_and_nobody_dials_itself(swarm: Swarm) -> None:
    found = links(swarm)
    assert all(len(link) == 2 for link in found)
    assert len(set(found)) == len(found)


@given(swarm=SWARMS)
@settings(max_examples=30)
def test_everybody_who_must_talk_is_linked(swarm: Swarm) -> None:
    _, formation = swarm
    found = set(links(swarm))
    for drone in formation.ids:
        assert {frozenset((drone_node(drone), other)) for other in (RELAY, BRIDGE, OBSERVER)} <= found
        for ancestor in formation.ancestors(drone):
            assert frozenset((drone_node(drone), drone_node(ancestor))) in found
    assert frozenset((WORLD, RELAY)) in found
    assert all(frozenset((OBSERVER, node)) in found for node in all_nodes(formation) if node != OBSERVER)


@given(swarm=SWARMS)
@settings(max_examples=30)
def test_whoever_hears_a_drone_is_linked_to_it(swarm: Swarm) -> None:
    scenario, formation = swarm
    found = set(links(swarm))
    for drone in formation.ids:
        heard = neighbours(scenario, formation, drone)
        assert drone not in heard
        assert list(heard) == sorted(heard)
        assert all(frozenset((drone_node(drone), drone_node(other))) in found for other in heard)


@pytest.mark.parametrize("n", [1, 2, FULL_MESH])
def test_a_small_swarm_hears_everybody(n: int) -> None:
    scenario, formation = swarm_of("line", n)
    for drone in formation.ids:
        assert set(neighbours(scenario, formation, drone)) == set(formation.ids) - {drone}


def test_a_large_swarm_hears_ancestors_and_those_near() -> None:
    scenario, formation = swarm_of("grid", 36)
    assert len(formation.ids) > FULL_MESH
    for one, other in itertools.permutations(formation.ids, 2):
        gap = math.dist(formation.rest[formation.row(one)], formation.rest[formation.row(other)])
        expected = gap <= NEAR or other in formation.ancestors(one)
        assert (other in neighbours(scenario, formation, one)) == expected
    assert any(len(neighbours(scenario, formation, drone)) < len(formation.ids) - 1 for drone in formation.ids)


def test_the_world_is_no_member_of_the_swarm() -> None:
    found = [link for link in links(swarm_of("rhombus", 4)) if WORLD in link]
    assert sorted(sorted(link - {WORLD})[0] for link in found) == [OBSERVER, RELAY]


def test_the_relay_dials_nobody() -> None:
    """A simplex sender needs to know nobody's address."""
    scenario, formation = swarm_of("rhombus", 4)
    assert dials(scenario, formation, RELAY) == []


def test_endpoints_are_counted_from_the_base_port_unless_given() -> None:
    scenario = load_scenario("rhombus", ["net.base_port=9000", "net.endpoints.drone/2=tcp/10.0.0.2:7447"])
    formation = build_formation(scenario)
    nodes = all_nodes(formation)
    assert nodes == ("relay", "drone/1", "drone/2", "drone/3", "drone/4", "world", "bridge", "observer")
    assert endpoint(scenario, formation, RELAY) == "tcp/127.0.0.1:9000"
    assert endpoint(scenario, formation, OBSERVER) == "tcp/127.0.0.1:9007"
    assert endpoint(scenario, formation, "drone/2") == "tcp/10.0.0.2:7447"
    assert "tcp/10.0.0.2:7447" in dials(scenario, formation, "drone/3")
    assert len({endpoint(scenario, formation, node) for node in nodes}) == len(nodes)


def test_a_pattern_names_every_endpoint_that_has_no_entry() -> None:
    items = ["net.endpoint=tcp/{node}.mesh:7447", "net.endpoints.relay=tcp/relay.hand:7447"]
    scenario = load_scenario("rhombus", items)
    formation = build_formation(scenario)
    assert endpoint(scenario, formation, "drone/3") == "tcp/drone-3.mesh:7447"
    assert dials(scenario, formation, "drone/2") == ["tcp/relay.hand:7447", "tcp/drone-1.mesh:7447"]


def test_clients_of_a_router_dial_it_alone_and_listen_nowhere() -> None:
    scenario = load_scenario("rhombus", ["net.router=tcp/10.0.0.9:7447", "net.endpoint=tcp/{node}:7447"])
    formation = build_formation(scenario)
    for node in all_nodes(formation):
        assert (endpoint(scenario, formation, node), dials(scenario, formation, node)) == (
            "",
            ["tcp/10.0.0.9:7447"],
        )


@given(swarm=SWARMS)
@settings(max_examples=30)
def test_the_word_of_anybody_goes_round_to_everybody_of_a_large_swarm(swarm: Swarm) -> None:
    scenario, formation = swarm
    told_by = {drone: tellers(scenario, formation, drone) for drone in formation.ids}
    if len(formation.ids) <= scenario.net.full_mesh:
        assert not any(told_by.values())
        return
    found = set(links(swarm))
    for drone, others in told_by.items():
        assert all(drone in told_by[other] for other in others)
        assert all(frozenset((drone_node(drone), drone_node(other))) in found for other in others)
    reached, pending = set(), [formation.ids[0]]
    while pending:
        reached.add(drone := pending.pop())
        pending += set(told_by[drone]) - reached
    assert reached == set(formation.ids)


def test_lines_that_refer_to_the_human_alone_tell_each_other() -> None:
    drones = ",".join(
        f'{{id={n},references=["{"human" if n % 10 == 1 else n - 1}"],offset=[-2.0,{(n - 1) // 10 * 4.0},0.0]}}'
        for n in range(1, 21)
    )
    scenario = load_scenario(
        "rhombus", [f"formation={{shape='custom',drones=[{drones}]}}", "swarm.law=stable", "fence.room=99"]
    )
    formation = build_formation(scenario)
    assert tellers(scenario, formation, 11) == (1, 12)
    assert tellers(scenario, formation, 5) == (4, 6)
