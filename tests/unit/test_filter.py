"""The safety filter alone: vehicles that obey it are flown at each other, whatever their missions want."""

import functools
import itertools
import math
import random

import pytest
from hypothesis import given
from hypothesis import settings as hypothesis
from hypothesis import strategies as st

from agents.control.safety.demands import SafetySettings
from agents.control.safety.encounter import (
    Berth,
    Clearance,
    Encounter,
    column_at,
    drone_heard,
    drone_silent,
    walker_seen,
)
from agents.control.safety.filter import Guarded, Wish, guard
from agents.control.safety.motion import Motion, start_motion, watch
from agents.control.vectors import ORIGIN, Vector
from agents.settings import HAND_COMFORT, clearances, safety_settings
from shared.config import load_scenario
from shared.envelope import load_envelope
from shared.formation import build_formation
from tests.values import replace

TICK = 1.0 / 60.0
BODIES = ("identified", "crazyflie")
EVERY_BODY = pytest.mark.parametrize("body", BODIES)
ANGLES = st.floats(-math.pi, math.pi)
SEEDS = st.integers(0, 2**32)


@functools.cache
def settings(body: str) -> SafetySettings:
    scenario = load_scenario("rhombus", ["fence.min=[-3,-3,-0.1]", "fence.max=[3,3,3]"])
    return safety_settings(scenario, build_formation(scenario), load_envelope(body))


@functools.cache
def clearance(body: str) -> Clearance:
    scenario = load_scenario("rhombus", [f"vehicles.all.body={body}"])
    return clearances(scenario, build_formation(scenario), 1)[2]


Said = tuple[Vector, Vector, Vector]
"""Point ahead, its pace, what is asked for."""


class Drone:
    """A vehicle that answers exactly as its envelope says; its mission wants velocities, no matter why."""

    def __init__(self, body: str, position: Vector, velocity: Vector = ORIGIN) -> None:
        self.settings = settings(body)
        self.position, self.velocity, self.actual = [*position], [*velocity], [0.0] * 3
        self.motion = start_motion(position, velocity, 0.0)
        self.guarded: Guarded | None = None
        self.at: Vector = position

    def fly(self, velocity: Vector, encounters: list[Encounter], *, floor: bool = True) -> Guarded:
        """Makes one control step and flies it; the mission accelerates as hard as the vehicle can."""
        rules = self.settings
        self.motion = watch(self.motion, self.at, self._velocity(), 0.0, TICK, rules.horizontal, rules.vertical)
        hard = self.settings.horizontal.acceleration
        x, y, z = self.position
        u, v, w = velocity
        far = Wish((x + u, y + v, z + w), velocity, hard)
        self.guarded = guard(far, self.motion, [], encounters, self.settings, TICK, floor=floor)
        told = self.motion = self.guarded.motion
        axes = (told.x, told.y, told.z)
        for axis, response in enumerate([self.settings.horizontal] * 2 + [self.settings.vertical]):
            for _ in range(4):
                asked = response.asks(
                    axes[axis].setpoint - self.position[axis], axes[axis].rate, self.velocity[axis], 0.0
                )
                decay = 0.0 if response.lag == 0.0 else math.exp(-TICK / 4 / response.lag)
                self.actual[axis] = asked + (self.actual[axis] - asked) * decay
                self.position[axis] += self.velocity[axis] * TICK / 4
                self.velocity[axis] += self.actual[axis] * TICK / 4
        a, b, c = self.position
        self.at = (a, b, c)
        return self.guarded

    def _velocity(self) -> Vector:
        u, v, w = self.velocity
        return (u, v, w)

    def said(self) -> Said:
        if self.guarded is None:
            return self.at, self._velocity(), ORIGIN
        return self.guarded.ahead, self.guarded.pace, self.guarded.asked


def planar(one: Vector, other: Vector) -> float:
    return math.hypot(one[0] - other[0], one[1] - other[1])


class Mission:
    """Wants another velocity every now and then, mostly towards someone."""

    def __init__(self, draw: random.Random, fastest: float) -> None:
        self.draw, self.fastest, self.left, self.velocity = draw, fastest, 0, ORIGIN

    def wants(self, own: Vector, target: Vector) -> Vector:
        if self.left <= 0:
            self.left = self.draw.randrange(5, 60)
            heading = math.atan2(target[1] - own[1], target[0] - own[0]) + self.draw.gauss(0.0, 0.7)
            speed = self.draw.uniform(0.0, self.fastest)
            self.velocity = (speed * math.cos(heading), speed * math.sin(heading), 0.0)
        self.left -= 1
        return self.velocity


def ring(n: int, spacing: float) -> list[Vector]:
    radius = spacing / (2.0 * math.sin(math.pi / n))
    return [
        (radius * math.cos(2.0 * math.pi * k / n), radius * math.sin(2.0 * math.pi * k / n), 1.2)
        for k in range(n)
    ]


def fly_together(body: str, n: int, seed: int, *, delay: int, loss: float) -> float:
    """Flies n drones at each other for 5 s and returns their smallest distance."""
    draw = random.Random(seed)
    drones = [Drone(body, place) for place in ring(n, 0.6)]
    missions = [Mission(draw, 1.0) for _ in drones]
    heard: dict[tuple[int, int], tuple[Said, int]] = {}
    for pair in itertools.permutations(range(n), 2):
        heard[pair] = (drones[pair[1]].said(), 0)
    said: list[list[Said]] = []
    smallest = math.inf
    for tick in range(300):
        said.append([drone.said() for drone in drones])
        for pair in heard:
            if draw.random() >= loss and tick >= delay:
                heard[pair] = (said[tick - delay][pair[1]], tick)
        before = [drone.at for drone in drones]
        for k, drone in enumerate(drones):
            target = before[draw.randrange(n)]
            encounters = [
                drone_heard(
                    *heard[k, other][0], (tick - heard[k, other][1]) * TICK, clearance(body), yields=True
                )
                for other in range(n)
                if other != k
            ]
            drone.fly(missions[k].wants(before[k], target), encounters)
        smallest = min(smallest, *(planar(a.at, b.at) for a, b in itertools.combinations(drones, 2)))
    return smallest


@EVERY_BODY
@given(seed=SEEDS, n=st.integers(2, 5), delay=st.sampled_from([0, 1, 3]), loss=st.sampled_from([0.0, 0.2]))
@hypothesis(max_examples=25, deadline=None)
def test_nobody_comes_nearer_than_that_whatever_the_missions_want(
    body: str, seed: int, n: int, delay: int, loss: float
) -> None:
    assert fly_together(body, n, seed, delay=delay, loss=loss) >= 0.20


@EVERY_BODY
@given(seed=SEEDS)
@hypothesis(max_examples=20, deadline=None)
def test_it_is_enough_that_one_of_two_looks(body: str, seed: int) -> None:
    """The other goes where it likes, but turns no harder than a third of what the one can."""
    draw = random.Random(seed)
    drone, mission = Drone(body, (0.0, 0.0, 1.2)), Mission(draw, 1.0)
    stray, wandering = Mission(draw, 0.5), ORIGIN
    turn = drone.settings.horizontal.acceleration / 3.0 * TICK
    x, y = 0.7, 0.0
    for _ in range(600):
        place = (x, y, 1.2)
        seen = drone_heard(place, wandering, ORIGIN, 0.0, clearance(body), yields=False)
        drone.fly(mission.wants(drone.at, place), [seen])
        u, v, _ = (
            now + min(max(wish - now, -turn), turn)
            for now, wish in zip(wandering, stray.wants(place, drone.at), strict=True)
        )
        wandering = (u, v, 0.0)
        x, y = x + u * TICK, y + v * TICK
        assert planar(drone.at, (x, y, 1.2)) >= 0.20


@EVERY_BODY
@given(heading=ANGLES, speed=st.floats(0.2, 2.0), climb=st.floats(-1.0, 1.0))
@hypothesis(max_examples=15, deadline=None)
def test_nobody_leaves_the_fence_or_touches_the_floor(
    body: str, heading: float, speed: float, climb: float
) -> None:
    drone = Drone(body, (0.0, 0.0, 1.2))
    for _ in range(480):
        drone.fly((speed * math.cos(heading), speed * math.sin(heading), climb), [])
        assert max(abs(drone.at[0]), abs(drone.at[1])) <= 3.0
        assert 0.05 <= drone.at[2] <= 3.0


@EVERY_BODY
def test_to_land_is_to_pass_the_floor(body: str) -> None:
    drone = Drone(body, (0.0, 0.0, 1.2))
    for _ in range(240):
        drone.fly((0.0, 0.0, -0.5), [], floor=False)
    assert drone.at[2] < 0.0


@EVERY_BODY
@given(heading=ANGLES, aside=st.floats(-0.3, 0.3), speed=st.floats(0.2, 1.5))
@hypothesis(max_examples=15, deadline=None)
def test_columns_are_passed_or_stopped_at(body: str, heading: float, aside: float, speed: float) -> None:
    c, s = math.cos(heading), math.sin(heading)
    place = (1.0 * c - aside * s, 1.0 * s + aside * c)
    rules = replace(settings(body), columns=[column_at(*place, 0.25, math.inf)])
    drone = Drone(body, (0.0, 0.0, 1.2))
    drone.settings = rules
    for _ in range(300):
        drone.fly((speed * c, speed * s, 0.0), [])
        assert planar(drone.at, (*place, 0.0)) >= 0.25 - 0.05


@EVERY_BODY
@given(heading=ANGLES, aside=st.floats(-0.2, 0.2))
@hypothesis(max_examples=15, deadline=None)
def test_a_hand_within_what_the_body_can_do_never_touches_it(body: str, heading: float, aside: float) -> None:
    """It comes with a quarter of what the body can accelerate by, up to a walking hand's speed, and goes on."""
    c, s = math.cos(heading), math.sin(heading)
    drone = Drone(body, (0.0, 0.0, 1.2))
    ease = 0.25 * drone.settings.horizontal.acceleration
    way, speed = -0.8, 0.0
    for _ in range(300):
        speed = min(speed + ease * TICK, 0.75)
        way += speed * TICK
        hand = (way * c - aside * s, way * s + aside * c, 1.2)
        flying = (speed * c, speed * s, 0.0)
        seen = walker_seen(hand, flying, 0.0, drone.settings.horizontal.lag, drone.settings.hand)
        drone.fly(ORIGIN, [seen])
        assert planar(drone.at, hand) >= 0.25


@EVERY_BODY
@given(
    position=st.tuples(*[st.floats(-2.0, 2.0)] * 2, st.floats(0.5, 2.0)),
    setpoint=st.tuples(*[st.floats(-0.01, 0.01)] * 3),
    heading=ANGLES,
    far=st.floats(1.5, 3.0),
)
def test_where_nothing_is_near_the_mission_is_flown_to_the_bit(
    body: str, position: Vector, setpoint: Vector, heading: float, far: float
) -> None:
    x, y, z = position
    wish = Wish((x + setpoint[0], y + setpoint[1], z + setpoint[2]), (0.1, 0.1, 0.0), 1.0)
    motion = start_motion(position, ORIGIN, 0.0)
    there = (x + far * math.cos(heading), y + far * math.sin(heading), z)
    others = [
        drone_heard(there, ORIGIN, ORIGIN, 0.05, clearance(body), yields=True),
        drone_silent(there, ORIGIN, 2.0, clearance(body), 0.1),
        walker_seen(there, ORIGIN, 0.0, 0.1, Berth(0.32, HAND_COMFORT)),
    ]
    guarded = guard(wish, motion, [], others, settings(body), TICK, floor=True)
    assert guarded.setpoint == wish.setpoint
    assert guarded.kept
    assert not guarded.planar
    assert not guarded.upright


def stacked(body: str, above: float) -> tuple[Drone, Encounter]:
    """A drone, and one straight above it."""
    drone = Drone(body, (0.05, 0.0, 1.2))
    return drone, drone_heard((0.0, 0.0, 1.2 + above), ORIGIN, ORIGIN, 0.0, clearance(body), yields=False)


@EVERY_BODY
@given(climb=st.floats(0.0, 1.0))
@hypothesis(max_examples=10, deadline=None)
def test_nobody_climbs_into_the_air_below_another(body: str, climb: float) -> None:
    drone, other = stacked(body, 1.3)
    for _ in range(240):
        drone.fly((0.0, 0.0, climb), [other])
    assert planar(drone.at, ORIGIN) < 0.06
    assert 1.2 - 0.05 <= drone.at[2] <= 1.5 + 0.1


@EVERY_BODY
def test_who_is_in_the_air_below_another_leaves_it(body: str) -> None:
    drone, other = stacked(body, 0.6)
    for _ in range(300):
        drone.fly(ORIGIN, [other])
    assert planar(drone.at, ORIGIN) >= 0.29


@EVERY_BODY
def test_nobody_says_that_it_is_asked_for_more_than_its_vehicle_can_do(body: str) -> None:
    """Who falls fast is demanded more than anybody can; neighbours would not believe a word of it."""
    drone = Drone(body, (0.0, 0.0, 0.6), (0.0, 0.0, -5.0))
    assert drone.fly(ORIGIN, []).asked[2] == drone.settings.vertical.acceleration


@EVERY_BODY
def test_who_crosses_above_or_below_is_let_pass(body: str) -> None:
    """More than the height of the downwash apart nobody is in anybody's way."""
    drone = Drone(body, (-1.0, 0.0, 0.5))
    other = drone_heard((0.0, 0.0, 2.2), ORIGIN, ORIGIN, 0.0, clearance(body), yields=False)
    for _ in range(240):
        drone.fly((0.6, 0.0, 0.0), [other])
    assert drone.at[0] > 0.5
    assert drone.at[2] == pytest.approx(0.5, abs=0.05)


@EVERY_BODY
@given(height=st.floats(0.0, 0.9), aside=st.floats(-0.2, 0.2), speed=st.floats(0.3, 0.8))
@hypothesis(max_examples=10, deadline=None)
def test_two_that_cross_do_so_outside_each_others_air(
    body: str, height: float, aside: float, speed: float
) -> None:
    """They meet head on, one above the other: they pass aside, or keep the height of the downwash."""
    kept = clearance(body)
    one, other = Drone(body, (-1.2, 0.0, 1.2)), Drone(body, (1.2, aside, 1.2 + height))
    for _ in range(420):
        said, heard = one.said(), other.said()
        one.fly((speed, 0.0, 0.0), [drone_heard(*heard, 0.0, kept, yields=True)])
        other.fly((-speed, 0.0, 0.0), [drone_heard(*said, 0.0, kept, yields=True)])
        level, apart = abs(one.at[2] - other.at[2]), planar(one.at, other.at)
        assert apart >= 0.20
        assert apart >= 0.27 or level >= 0.95


@given(age=st.floats(0.1, 10.0), speed=st.floats(0.1, 1.0))
def test_a_silent_body_may_be_anywhere_on_its_way(age: float, speed: float) -> None:
    """Whoever stands where it could have come to by now has to leave, and where it was as well."""
    kept = clearance("identified")
    silent = drone_silent((0.0, 0.0, 1.2), (speed, 0.0, 0.0), age, kept, 0.0)
    for share in (0.0, 0.5, 1.0):
        here = (share * min(age, 2.5) * speed, 0.1, 0.9)
        still = Wish(here, ORIGIN, 1.0)
        guarded = guard(
            still, start_motion(here, ORIGIN, 0.0), [], [silent], settings("identified"), TICK, floor=True
        )
        assert guarded.planar
        assert guarded.setpoint[1] > here[1]


def test_who_never_yields_comes_before_who_does() -> None:
    """Between a hand and a drone it goes as far from the hand as it can."""
    here: Vector = (0.0, 0.0, 1.2)
    rules, kept = settings("identified"), clearance("identified")
    hand = walker_seen((-0.25, 0.0, 1.2), (0.8, 0.0, 0.0), 0.0, 0.0, rules.hand)
    drone = drone_heard((0.25, 0.0, 1.2), ORIGIN, ORIGIN, 0.0, kept, yields=True)
    motion: Motion = start_motion(here, ORIGIN, 0.0)
    guarded = guard(Wish(here, ORIGIN, 1.0), motion, [hand], [drone], rules, TICK, floor=True)
    assert guarded.setpoint[0] > 0.2
    assert not guarded.kept
