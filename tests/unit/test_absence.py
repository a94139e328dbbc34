"""A formation without some of its drones: everybody else keeps its place, and nobody waits for them."""

import itertools

import numpy as np
import pytest

from deploy.lockstep.lockstep import fly_lockstep
from shared.arrays import rest_of, weights_of
from shared.config import dump_scenario, load_scenario
from shared.errors import ConfigError
from shared.formation import build_formation
from shared.nodes import all_nodes
from shared.scenario_check.check import open_scenario
from tests.hands import stroke

SUBSETS = [subset for size in (1, 2, 3) for subset in itertools.combinations((1, 2, 3, 4), size)]


@pytest.mark.parametrize("absent", SUBSETS, ids=str)
def test_the_others_keep_their_places(absent: tuple[int, ...]) -> None:
    whole = build_formation(load_scenario("rhombus"))
    left = build_formation(load_scenario("rhombus", [f"formation.absent={list(absent)}"]))
    assert left.ids == tuple(drone for drone in whole.ids if drone not in absent)
    kept = [whole.row(drone) for drone in left.ids]
    assert rest_of(left) == pytest.approx(rest_of(whole)[kept])
    assert weights_of(left).sum(axis=1) == pytest.approx(1.0)
    assert {name for link in left.links for name in link.name.split("-")} <= {"human", *map(str, left.ids)}
    assert not {f"drone/{drone}" for drone in absent} & set(all_nodes(left))


def test_a_chain_of_absent_drones_is_followed_to_its_end() -> None:
    whole = build_formation(load_scenario("line", ["formation.n=6"]))
    left = build_formation(load_scenario("line", ["formation.n=6", "formation.absent=[2,3,4]"]))
    assert left.references(5) == (1,)
    assert rest_of(left) == pytest.approx(rest_of(whole)[[0, 4, 5]])


def test_they_take_off_and_follow_without_waiting() -> None:
    scenario, formation = open_scenario("rhombus", ["formation.absent=[1]"], network=False)
    record = fly_lockstep(scenario, formation, stroke(np.pi, 0.4, 0.4, before=7.0, after=2.0), airborne=False)
    assert record.position[-1] == pytest.approx(record.hand.point[-1] + rest_of(formation), abs=0.15)


@pytest.mark.parametrize(
    ("absent", "why"), [("[9]", "no drone 9"), ("[1,2,3,4]", "nobody is left"), ("1", "a list is expected")]
)
def test_what_cannot_be_is_refused(absent: str, why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        build_formation(load_scenario("rhombus", [f"formation.absent={absent}"]))


def test_a_resolved_scenario_with_settings_for_an_absent_drone_passes() -> None:
    more = ("formation.absent=[2]", "vehicles.robots.2.tau=0.5", "net.endpoints.drone/2=tcp/127.0.0.1:9001")
    scenario, formation = open_scenario("rhombus", more)
    assert "absent = [" in dump_scenario(scenario)
    assert formation.ids == (1, 3, 4)
