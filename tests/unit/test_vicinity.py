"""In a swarm in which not everybody hears everybody: who comes near is told, then heard, then let go of."""

import math
from typing import Any

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from agents.agent import Agent
from agents.near_links import AGAIN_NS, NearLinks
from agents.settings import agent_settings
from agents.vehicles.world.setup import referee_rules
from agents.vicinity import APART, MOST_NEAR, Sighting, Vicinity, hear_places, tell, who_comes_near
from deploy.falsify.case import Case, Fault, Stroke, Weather
from deploy.falsify.hand import poses, samples
from deploy.falsify.judge import judge
from deploy.falsify.swarm import Swarm, _start, fly, prepare
from shared.clock import NS_PER_S
from shared.codec import MAX_PAYLOAD, decode, encode
from shared.config import load_scenario
from shared.errors import DecodeError, DeviceError
from shared.formation import build_formation
from shared.memory_bus import MemoryBus, MemoryNetwork
from shared.messages import MOST_SEEN, ORIGIN, Mode, Places, Seen, Vector
from shared.nodes import NEAR, neighbours
from shared.senses import Sensed, Senses
from shared.topics import DRONE_STATE, PLACES
from shared.transport import Arrival, Inbox
from tests.unit.test_agent import T0, state

MS = 1_000_000


def seen(drone: int, place: Vector, seq: int = 5, velocity: Vector = ORIGIN, age: float = 0.0) -> Seen:
    return Seen(drone, T0, seq, place, velocity, Mode.FOLLOW, age)


def sighted(drone: int, place: Vector, velocity: Vector = ORIGIN, age: float = 0.0) -> Sighting:
    return Sighting(seen(drone, place, velocity=velocity), T0 - round(age * NS_PER_S))


def places(teller: int, *found: Seen, seq: int = 0) -> Sensed[Places]:
    return Sensed(Places(epoch=T0, seq=seq, stamp_ns=T0, id=teller, seen=found), T0)


def near(*sightings: Sighting, before: frozenset[int] = frozenset()) -> frozenset[int]:
    return who_comes_near(ORIGIN, ORIGIN, {each.seen.id: each for each in sightings}, before, T0)


def test_who_is_near_or_will_be_soon_is_to_be_heard() -> None:
    assert near(sighted(2, (NEAR - 0.1, 0, 0)), sighted(3, (NEAR + 0.1, 0, 0))) == {2}
    assert near(sighted(3, (0, NEAR + 0.5, 0), velocity=(0, -0.6, 0))) == {3}
    assert near(sighted(3, (0, NEAR + 0.5, 0), velocity=(0, 0.6, 0))) == set()
    assert near(sighted(4, (0, NEAR + 0.5, 0), age=1.1)) == {4}, "it may have come nearer"


def test_who_is_heard_is_let_go_of_later() -> None:
    edge = sighted(2, (NEAR + APART - 0.1, 0, 0))
    assert near(edge) == set()
    assert near(edge, before=frozenset({2})) == {2}


def test_of_many_the_nearest_are_heard() -> None:
    crowd = [sighted(n, (0.01 * n, 0.0, 0.0)) for n in range(2, 60)]
    assert near(*crowd) == set(range(2, 2 + MOST_NEAR))


def test_the_newest_word_counts_and_what_cannot_be_does_not() -> None:
    known: dict[int, Sighting] = {}
    hear_places(known, places(2, seen(7, (1.0, 0, 1.0), seq=5, age=0.4)))
    hear_places(known, places(3, seen(7, (5.0, 0, 1.0), seq=4)))
    assert known[7].seen.position == (1.0, 0, 1.0)
    assert known[7].age(T0) == pytest.approx(0.4)
    hear_places(known, places(3, seen(7, (90.0, 0, 1.0), seq=6)))
    assert known[7].seen.seq == 5
    hear_places(known, places(3, seen(7, (1.2, 0, 1.0), seq=6)))
    assert known[7].seen.seq == 6


def test_what_is_told_fits_into_a_message_however_many_there_are() -> None:
    far = {n: Sighting(seen(n, (-1 / 3 * n, 1 / 7, 1.0), seq=2**40), T0) for n in range(2, 200)}
    told = tell(seen(1, ORIGIN), far, T0)
    assert len(told) == MOST_SEEN
    assert [each.id for each in told] == list(range(1, MOST_SEEN + 1))
    message = Places(epoch=2**64 - 1, seq=2**64 - 1, stamp_ns=2**64 - 1, id=65_535, seen=told)
    payload = encode(message)
    assert len(payload) <= MAX_PAYLOAD
    assert decode(payload, Places) == message


def test_senses_hear_places_only_of_those_whom_they_hear() -> None:
    senses = Senses([2], places=True)
    assert senses.keys[1:] == [DRONE_STATE.key(id=2), PLACES.key(id=2)]
    for teller in (2, 3):
        told = places(teller, seen(7, ORIGIN)).message
        senses.take({PLACES.key(id=teller): [Arrival(encode(told), T0)]})
    assert [sensed.message.id for sensed in senses.places] == [2]
    assert senses.rejected == {"unknown-key": 1}
    senses.listen([3])
    senses.take({PLACES.key(id=3): [Arrival(encode(places(3).message), T0)]})
    assert [sensed.message.id for sensed in senses.places] == [2, 3]
    with pytest.raises(DecodeError, match=r"after"):
        senses.hear_places(places(3))


def test_who_is_near_counts_once_a_link_had_its_time() -> None:
    vicinity = Vicinity(1, always=[2], others=[1, 2, 3, 4])
    vicinity.hear([places(2, seen(3, (1.0, 0, 1.0)), seen(4, (9.0, 0, 1.0)))])
    vicinity.look(ORIGIN, ORIGIN, {}, T0)
    assert vicinity.near == {3}
    assert vicinity.counted({}, T0 + 900 * MS) == []
    assert vicinity.counted({3: Sensed(state(3, 1), T0 + 100 * MS)}, T0 + 200 * MS) == [3]
    assert vicinity.counted({}, T0 + 1100 * MS) == [3]
    assert [each.id for each in vicinity.told_of([3, 9], T0)] == [3]


def test_a_drone_on_the_ground_comes_near_nobody() -> None:
    vicinity = Vicinity(1, always=[2], others=[3])
    vicinity.hear([places(2, seen(3, ORIGIN)._replace(mode=Mode.GROUND))])
    vicinity.look(ORIGIN, ORIGIN, {}, T0)
    assert vicinity.near == set()


def big_agent() -> Agent:
    scenario = load_scenario("line", ["formation.n=20", "net.full_mesh=0", "swarm.law=stable"])
    formation = build_formation(scenario)
    return Agent(scenario, formation, 1, agent_settings(scenario, formation, 1), epoch=T0)


def test_an_agent_tells_a_few_times_a_second_whom_it_saw() -> None:
    brain = big_agent()
    told = [brain.places(state(1, k)) for k in range(3)]
    assert told[0] is not None
    assert [each.id for each in told[0].seen] == [1]
    assert told[1:] == [None, None]
    later = brain.places(replace(state(1, 9), step_ns=T0 + NS_PER_S))
    assert later is not None
    assert later.seq == 1


def test_a_small_swarm_tells_nothing() -> None:
    scenario = load_scenario("rhombus")
    formation = build_formation(scenario)
    brain = Agent(scenario, formation, 1, agent_settings(scenario, formation, 1), epoch=T0)
    assert brain.places(state(1, 0)) is None
    assert brain.near == set()


class Links:
    """Opens links in memory, or cannot."""

    def __init__(self) -> None:
        self.network = MemoryNetwork()
        self.now = T0
        self.opened: list[int] = []
        self.inbox = Inbox(lambda: self.now)
        self.works = True
        self.near = NearLinks(self.reach, lambda n: [DRONE_STATE.key(id=n)], self.inbox, lambda: self.now)

    def reach(self, drone: int) -> MemoryBus:
        if not self.works:
            raise DeviceError("nobody there")
        self.opened.append(drone)
        return MemoryBus(self.network)


def test_links_are_opened_heard_and_closed() -> None:
    links = Links()
    publish = MemoryBus(links.network).publisher(DRONE_STATE, id=3)
    links.near.follow(frozenset({3}))
    links.near.follow(frozenset({3}))
    publish(b"here")
    assert [arrival.payload for arrival in links.inbox.take()[DRONE_STATE.key(id=3)]] == [b"here"]
    links.near.follow(frozenset())
    publish(b"gone")
    assert links.inbox.take() == {}
    assert links.opened == [3]
    assert len(links.network.buses) == 1


def test_who_cannot_be_reached_is_tried_again(caplog: pytest.LogCaptureFixture) -> None:
    links = Links()
    links.works = False
    for _ in range(3):
        links.near.follow(frozenset({3}))
    assert len(caplog.messages) == 1
    links.works, links.now = True, links.now + AGAIN_NS
    links.near.follow(frozenset({3}))
    assert links.opened == [3]
    links.near.close()
    assert links.network.buses == []


# A vee of 20: the ends of its two arms are 10 m apart, and never heard each other.
SPREAD = ("formation.n=20", "vehicles.all.body=identified")
ENDS = (19, 20)


def crossing(**more: Any) -> Case:
    """The hand turns the formation over the place where one end of the vee is held."""
    sway = tuple(
        Stroke(to=(x, y, 1.2), peak=1.2) for x, y in ((0.0, -3.0), (-2.0, 2.0), (1.0, -2.0), (0.0, 3.0))
    )
    case = Case(scenario="vee", overrides=SPREAD, seconds=24.0, hand=(0.0, 0.0, 1.2), strokes=sway)
    return evolve(case, **more)


def test_a_held_drone_is_heard_by_everybody_who_comes_near() -> None:
    case = crossing(faults=(Fault(kind="held", drone=20, start=0.0, end=60.0),))
    scenario, formation = prepare(case.scenario, case.overrides)
    strangers = [d for d in formation.ids if 20 not in neighbours(scenario, formation, d) and d != 20]
    assert len(strangers) > 5
    said = samples(case, poses(case, 60.0))
    swarm = Swarm(case, scenario, formation, _start(case, scenario, formation, said[0]))
    met, unheard = set(), []
    for sample in said:
        row = swarm.advance(sample)
        places = np.array(row[0])
        gaps = np.linalg.norm(places - places[formation.row(20)], axis=1)
        for drone in strangers:
            agent = swarm._agents[formation.row(drone)]
            assert agent is not None
            if gaps[formation.row(drone)] < 1.0:
                met.add(drone)
                if not agent.senses.hears(20):
                    unheard.append(drone)
    assert len(met) >= 2, "nobody came near: the hand has to move otherwise"
    assert unheard == []
    assert judge(fly(case), referee_rules(scenario, formation, formation.ids))["drones"].value >= 0.12


def test_it_is_heard_through_bad_weather_too() -> None:
    case = crossing(
        faults=(Fault(kind="held", drone=20, start=0.0, end=60.0),), weather=Weather(loss=0.2, delay=0.05)
    )
    scenario, formation = prepare(case.scenario, case.overrides)
    assert judge(fly(case), referee_rules(scenario, formation, formation.ids))["drones"].value >= 0.12


@given(st.lists(st.tuples(st.integers(2, 9), st.floats(-5, 5), st.floats(-5, 5)), max_size=8))
def test_nobody_beyond_reach_is_ever_wanted(found: list[tuple[int, float, float]]) -> None:
    sightings = [sighted(n, (x, y, 0.0)) for n, x, y in found]
    wanted = near(*sightings)
    for each in {s.seen.id: s for s in sightings}.values():
        assert (math.hypot(*each.seen.position[:2]) < NEAR) == (each.seen.id in wanted)
