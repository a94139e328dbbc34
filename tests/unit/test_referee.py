"""The referee against brute force, and what counts once."""

import math
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.vehicles.world.referee import RefereeState, Rules, report, update
from shared.cylinders import Cylinder
from shared.messages import ORIGIN, Vector

IDS = (1, 2, 4, 7)
AIR, DOWN = [True] * 4, [False] * 4
APART: list[Vector] = [(0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (0.0, 1.0, 1.0), (1.0, 1.0, 1.0)]

coordinates = st.floats(-2.0, 2.0)
places = st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=4, max_size=4)
instants = st.lists(st.tuples(places, st.tuples(*[st.booleans()] * 4)), min_size=1, max_size=5)


def make_rules(*columns: tuple[float, float]) -> Rules:
    return Rules(
        ids=IDS,
        columns=tuple(Cylinder(x, y, 0.12) for x, y in columns),
        fence=((-3.0, -3.0, -0.1), (3.0, 3.0, 3.0)),
    )


def watch(rules: Rules, *track: list[Vector]) -> RefereeState:
    state = RefereeState()
    for t, positions in enumerate(track):
        state = update(rules, state, positions, AIR, hand=None, t=float(t))
    return state


@given(instants)
def test_smallest_distances_are_those_of_brute_force(
    seen: list[tuple[list[tuple[float, float, float]], tuple[bool, ...]]],
) -> None:
    rules, hand = make_rules(), (0.5, 0.5, 1.0)
    state = RefereeState()
    pair = to_hand = math.inf
    for t, (points, flying) in enumerate(seen):
        state = update(rules, state, points, flying, hand=hand, t=float(t))
        for i, j in combinations(range(4), 2):
            if flying[i] or flying[j]:
                pair = min(pair, math.dist(points[i], points[j]))
        to_hand = min([to_hand, *(math.dist(p, hand) for p, up in zip(points, flying, strict=True) if up)])
    assert state.pair.distance == pytest.approx(pair)
    assert state.hand.distance == pytest.approx(to_hand)
    if any(any(flying) for _, flying in seen):
        points, flying = seen[int(state.pair.t)]
        i, j = (IDS.index(drone) for drone in state.pair.drones)
        assert math.dist(points[i], points[j]) == pytest.approx(pair)
        assert flying[i] or flying[j]


def test_a_contact_counts_once_per_episode() -> None:
    close = APART.copy()
    close[1] = (0.1, 0.0, 1.0)
    numbers = report(watch(make_rules(), APART, close, close, APART, close))
    assert numbers["collisions"] == 2
    assert (numbers["min_distance_from"], numbers["min_distance_to"]) == (1, 2)
    assert numbers["min_distance_m"] == pytest.approx(0.1)
    assert numbers["min_distance_t_s"] == 1.0


def test_just_outside_contact_is_no_collision() -> None:
    close = APART.copy()
    close[1] = (0.121, 0.0, 1.0)
    assert report(watch(make_rules(), close))["collisions"] == 0


def test_column_contact_has_no_height() -> None:
    near, clear = (0.17, 0.0), (-0.19, 0.0)
    assert report(watch(make_rules(near), APART, APART))["column_contacts"] == 1
    assert report(watch(make_rules(near), APART))["collisions"] == 1
    assert report(watch(make_rules(clear), APART))["collisions"] == 0


def test_fence_exit_counts_once_per_episode_and_only_in_the_air() -> None:
    out = APART.copy()
    out[2] = (0.0, 3.1, 1.0)
    rules = make_rules()
    assert report(watch(rules, APART, out, out, APART, out))["fence_exits"] == 2
    state = update(rules, RefereeState(), out, DOWN, hand=None, t=0.0)
    assert report(state)["fence_exits"] == 0


def test_grounded_drones_do_not_count() -> None:
    rules, close = make_rules(), [ORIGIN] * 4
    state = update(rules, RefereeState(), close, DOWN, hand=ORIGIN, t=0.0)
    assert report(state) == {
        "collisions": 0,
        "column_contacts": 0,
        "obstacle_contacts": 0,
        "fence_exits": 0,
    }


def test_landing_ends_an_episode() -> None:
    rules, close = make_rules(), APART.copy()
    close[1] = (0.1, 0.0, 1.0)
    state = watch(rules, close)
    state = update(rules, state, close, DOWN, hand=None, t=1.0)
    state = update(rules, state, close, AIR, hand=None, t=2.0)
    assert report(state)["collisions"] == 2
