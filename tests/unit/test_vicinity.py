"""In a swarm in which not everybody hears everybody: who comes near is told, then heard, then let go of."""

import math
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from agents.agent import Agent, memories
from agents.near_links import AGAIN_NS, NearLinks
from agents.settings import agent_settings
from agents.vehicles.world.referee import Rules
from agents.vehicles.world.setup import referee_rules
from agents.vicinity import APART, MOST_NEAR, Vicinity, newest, who_comes_near
from deploy.falsify.case import Case, Fault, Stroke, Weather
from deploy.falsify.hand import poses, samples
from deploy.falsify.judge import judge
from deploy.falsify.swarm import Flown, Swarm, _start, prepare
from shared.clock import NS_PER_S
from shared.codec import MAX_PAYLOAD, decode, encode
from shared.config import load_scenario
from shared.envelope import envelope_of
from shared.errors import DeviceError
from shared.formation import build_formation
from shared.memory_bus import MemoryBus, MemoryNetwork
from shared.messages import MOST_SEEN, ORIGIN, Mode, Places, Seen, Vector
from shared.nodes import NEAR, neighbours
from shared.senses import Sensed, Senses
from shared.topics import DRONE_STATE, PLACES
from shared.transport import Arrival, Inbox
from tests.unit.test_agent import T0, state

MS = 1_000_000
OWN = Seen(1, T0, 0, ORIGIN, ORIGIN, Mode.FOLLOW, 0.0)
MEMORIES = memories(load_scenario("rhombus"), range(2, 100))


def seen(drone: int, place: Vector, seq: int = 5, velocity: Vector = ORIGIN, age: float = 0.0) -> Seen:
    return Seen(drone, T0, seq, place, velocity, Mode.FOLLOW, age)


def places(teller: int, *found: Seen, seq: int = 0, at_ns: int = T0) -> Sensed[Places]:
    return Sensed(Places(epoch=T0, seq=seq, stamp_ns=T0, id=teller, seen=found), at_ns)


def near(*strangers: Seen, before: frozenset[int] = frozenset()) -> frozenset[int]:
    return who_comes_near(OWN, strangers, before)


def known(*told: Sensed[Places], now_ns: int = T0) -> dict[int, Seen]:
    told_by = {sensed.message.id: sensed for sensed in told}
    return {drone: each.now(now_ns) for drone, each in newest(range(2, 100), {}, told_by, now_ns).items()}


def test_who_is_near_or_will_be_soon_is_to_be_heard() -> None:
    assert near(seen(2, (NEAR - 0.1, 0, 0)), seen(3, (NEAR + 0.1, 0, 0))) == {2}
    assert near(seen(3, (0, NEAR + 0.5, 0), velocity=(0, -0.6, 0))) == {3}
    assert near(seen(3, (0, NEAR + 0.5, 0), velocity=(0, 0.6, 0))) == set()
    assert near(seen(4, (0, NEAR + 0.5, 0), age=1.1)) == {4}, "it may have come nearer"


def test_who_is_heard_is_let_go_of_later() -> None:
    edge = seen(2, (NEAR + APART - 0.1, 0, 0))
    assert near(edge) == set()
    assert near(edge, before=frozenset({2})) == {2}


def test_of_many_the_nearest_are_heard() -> None:
    crowd = [seen(n, (0.01 * n, 0.0, 0.0)) for n in range(2, 60)]
    assert near(*crowd) == set(range(2, 2 + MOST_NEAR))


@given(st.lists(st.tuples(st.integers(2, 9), st.floats(-5, 5), st.floats(-5, 5)), max_size=8))
def test_of_those_at_rest_exactly_who_is_within_reach_is_wanted(found: list[tuple[int, float, float]]) -> None:
    strangers = {n: seen(n, (x, y, 0.0)) for n, x, y in found}
    within = {n for n, each in strangers.items() if math.hypot(*each.position[:2]) < NEAR}
    assert near(*strangers.values()) == within


def test_the_newest_word_counts() -> None:
    older, newer = seen(7, (5.0, 0, 1.0), seq=4), seen(7, (1.0, 0, 1.0), seq=5, age=0.4)
    assert known(places(2, newer), places(3, older))[7] == newer


def test_a_number_out_of_the_future_is_forgotten_once_nobody_says_it_anew() -> None:
    lie, truth = seen(7, (5.0, 0, 1.0), seq=2**60), seen(7, (1.0, 0, 1.0), seq=5)
    later = T0 + round(1.1 * NS_PER_S)
    assert known(places(2, lie), places(3, truth))[7].seq == 2**60
    assert known(places(2, lie), places(3, truth, at_ns=later), now_ns=later)[7].seq == 5


def test_a_word_that_comes_back_makes_nothing_younger() -> None:
    word, echo = seen(7, ORIGIN, age=0.5), seen(7, ORIGIN, age=0.45)
    assert known(places(2, word), places(3, echo))[7].age == pytest.approx(0.5)


def test_nobody_can_tell_of_one_that_is_heard() -> None:
    heard = {7: Sensed(state(7, 3), T0)}
    told = {2: places(2, seen(7, (5.0, 5.0, 1.0), seq=9))}
    assert newest([7], heard, told, T0 + 100 * MS)[7].seen.seq == 3
    assert newest([7], heard, told, T0 + NS_PER_S)[7].seen.seq == 9


def test_what_is_told_fits_into_a_message_however_many_there_are() -> None:
    crowd = places(2, *(seen(n, (-1 / 3 * n, 1 / 7, 1.0), seq=2**40) for n in range(2, 90)))
    told = Vicinity([], MEMORIES).look(OWN, {}, {2: crowd}, T0)
    assert [each.id for each in told] == list(range(1, MOST_SEEN + 1))
    message = Places(epoch=2**64 - 1, seq=2**64 - 1, stamp_ns=2**64 - 1, id=65_535, seen=told)
    payload = encode(message)
    assert len(payload) <= MAX_PAYLOAD
    assert decode(payload, Places) == message


def test_senses_hear_of_others_from_tellers_only() -> None:
    senses = Senses([2], aside=[3], tellers=[2])
    assert senses.keys[1:] == [DRONE_STATE.key(id=2), PLACES.key(id=2)]
    for teller in (2, 3):
        told = places(teller, seen(7, ORIGIN)).message
        senses.take({PLACES.key(id=teller): [Arrival(encode(told), T0)]})
    assert list(senses.places) == [2]
    senses.take({PLACES.key(id=2): [Arrival(encode(places(3).message), T0)]})
    senses.take({PLACES.key(id=2): [Arrival(encode(places(2).message), T0)]})
    assert senses.rejected == {"unknown-key": 1, "wrong-id": 1, "out-of-order": 1}
    senses.take({DRONE_STATE.key(id=3): [Arrival(encode(state(3, 0)), T0)]})
    assert list(senses.drones) == [3], "heard over a link of its own"


def test_who_is_near_counts_once_a_link_had_its_time() -> None:
    vicinity = Vicinity([2], MEMORIES)
    told = {2: places(2, seen(3, (1.0, 0, 1.0)), seen(4, (9.0, 0, 1.0)))}
    vicinity.look(OWN, {}, told, T0)
    assert vicinity.near == {3}
    assert vicinity.counted({}, T0 + 900 * MS) == []
    assert vicinity.counted({3: Sensed(state(3, 1), T0 + 100 * MS)}, T0 + 200 * MS) == [3]
    assert vicinity.counted({}, T0 + 1100 * MS) == [3]
    told_of = vicinity.known(T0 + 100 * MS)(3)
    assert told_of is not None
    assert told_of.age == pytest.approx(0.1)
    assert vicinity.known(T0)(9) is None


def test_who_cannot_be_in_the_air_any_more_comes_near_nobody() -> None:
    vicinity = Vicinity([2], MEMORIES)
    landed, lost = seen(3, ORIGIN)._replace(mode=Mode.GROUND), seen(4, ORIGIN, age=60.0)
    vicinity.look(OWN, {}, {2: places(2, landed, lost)}, T0)
    assert vicinity.near == set()


def big_agent(drone: int = 1) -> Agent:
    scenario = load_scenario("line", ["formation.n=20", "net.full_mesh=0", "swarm.law=stable"])
    formation = build_formation(scenario)
    return Agent(scenario, formation, drone, agent_settings(scenario, formation, drone), epoch=T0)


def test_an_agent_tells_a_few_times_a_second_whom_it_knows() -> None:
    from tests.unit.test_agent import FLYING  # noqa: PLC0415

    brain, told = big_agent(), []
    for k in range(30):
        brain.step(T0 + k * 17 * MS, FLYING, 0.0)
        if (said := brain.places()) is not None:
            told.append(said)
    assert [each.seq for each in told] == [0, 1, 2]
    assert [each.id for each in told[0].seen] == [1]


def test_one_that_comes_near_is_kept_away_from_before_and_after_it_is_heard() -> None:
    from tests.unit.test_agent import FLYING  # noqa: PLC0415

    brain = big_agent()
    stranger = next(d for d in range(2, 21) if not brain.hears(d))
    teller = min(brain.tellers)
    here = seen(stranger, FLYING.position)
    brain.receive({PLACES.key(id=teller): [Arrival(encode(places(teller, here).message), T0)]})
    brain.step(T0, FLYING, 0.0)
    assert brain.near == {stranger}
    assert brain.hears(stranger)
    assert [each.id for each in brain._look_around(T0).missing] == [stranger]
    brain.receive({DRONE_STATE.key(id=stranger): [Arrival(encode(state(stranger, 7)), T0 + MS)]})
    company = brain._look_around(T0 + 2 * MS)
    assert stranger in [sensed.message.id for sensed in company.heard]
    assert company.missing == []


def test_a_small_swarm_tells_nothing() -> None:
    from tests.unit.test_agent import FLYING, agent  # noqa: PLC0415

    brain = agent(1)
    brain.step(T0, FLYING, 0.0)
    assert brain.places() is None
    assert not brain.near | brain.tellers


class AtOnce(Executor):
    """Does everything on the spot."""

    def submit(self, what: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        done: Future[Any] = Future()
        done.set_result(what(*args, **kwargs))
        return done


class Links:
    """Opens links in memory, or cannot."""

    def __init__(self) -> None:
        self.network = MemoryNetwork()
        self.now = T0
        self.opened: list[int] = []
        self.inbox = Inbox(lambda: self.now)
        self.works = True
        self.near = NearLinks(self.reach, self.inbox, lambda: self.now, AtOnce())

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


# A vee of 18: the ends of its two arms are 10 m apart, and never hear each other at rest.
SPREAD, END = ("formation.n=18",), 18


def crossing(**more: Any) -> Case:
    """The hand turns the formation over the place where one end of the vee is held."""
    sway = tuple(Stroke(to=(x, y, 1.2), peak=1.5) for x, y in ((0.0, -3.0), (-2.0, 2.0)))
    held = Fault(kind="held", drone=END, start=0.0, end=60.0)
    case = Case(
        scenario="vee", overrides=SPREAD, seconds=11.0, hand=(0.0, 0.0, 1.2), strokes=sway, faults=(held,)
    )
    return evolve(case, **more)


@pytest.mark.parametrize("weather", [Weather(), Weather(loss=0.2, delay=0.05)], ids=["fair", "bad"])
def test_a_held_drone_is_heard_by_everybody_who_comes_near(weather: Weather) -> None:
    case = crossing(weather=weather)
    scenario, formation = prepare(case.scenario, case.overrides)
    strangers = [d for d in formation.ids if END not in neighbours(scenario, formation, d) and d != END]
    assert len(strangers) > 5
    hand = poses(case, 60.0)
    said = samples(case, hand)
    swarm = Swarm(case, scenario, formation, _start(case, scenario, formation, said[0]))
    met, unheard, rows = set(), [], []
    for sample in said:
        rows.append(swarm.advance(sample))
        bodies = np.array(rows[-1][0])
        gaps = np.linalg.norm(bodies - bodies[formation.row(END)], axis=1)
        for drone in strangers:
            agent = swarm._agents[formation.row(drone)]
            assert agent is not None
            if gaps[formation.row(drone)] < 1.0:
                met.add(drone)
                if END not in agent.senses.drones or not agent.hears(END):
                    unheard.append(drone)
    assert len(met) >= 2, "nobody came near: the hand has to move otherwise"
    assert unheard == []
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    flown = Flown(
        t=np.array([pose.t_ns / NS_PER_S for pose in hand]),
        hand=np.array([pose.position for pose in hand]),
        position=columns[0],
        able=columns[1],
        hearing=columns[2],
        guided=columns[3],
        vehicles=tuple(envelope_of(scenario, drone).horizontal for drone in formation.ids),
    )
    rules: Rules = referee_rules(scenario, formation, formation.ids)
    assert judge(flown, rules)["drones"].value >= 0.20


def test_states_of_one_that_died_far_away_make_nobody_land() -> None:
    """Whoever never listened to it knows it alive no better than those who did."""
    brain = big_agent(3)
    company = brain._look_around(T0)
    assert company.awaited
    now = T0
    for k in range(90):
        now = T0 + k * 17 * MS
        told = {}
        for other in range(1, 21):
            if brain.hears(other) and (other != 2 or k == 0):
                said = replace(state(other, k), step_ns=now)
                told[DRONE_STATE.key(id=other)] = [Arrival(encode(said), now)]
        brain.receive(told)
    company = brain._look_around(now)
    assert [each.id for each in company.missing] == [2]
    assert not company.missed
