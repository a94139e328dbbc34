"""What moves among the drones: walkers of the world, who hears them, where they count and are shown."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from agents.agent import Agent
from agents.settings import agent_settings
from agents.vehicles.base import Pose
from agents.vehicles.world.crowd import Crowd
from agents.vehicles.world.referee import RefereeState, Rules, report, update
from agents.vehicles.world.walkers import VALID_S, obstacles_at, walk
from deploy.falsify.judge import _surface_gaps
from observer.trace.scene import Scene
from shared.clock import NS_PER_S
from shared.codec import decode, encode
from shared.config import load_scenario, structure_scenario
from shared.cylinders import Cylinder, columns_of, cylinder_of
from shared.errors import ConfigError, DecodeError
from shared.formation import build_formation
from shared.memory_bus import MemoryBus, MemoryNetwork
from shared.messages import ORIGIN, DroneState, Flag, ObstacleState, Vector
from shared.net.access import writes
from shared.nodes import WORLD, dials, drone_node, endpoint
from shared.obstacle_watch import MOST_OBSTACLES, ObstacleWatch
from shared.scenario import Walker
from shared.senses import Senses
from shared.topics import OBSTACLE
from shared.transport import Arrival, Inbox

T0 = 1_800_000_000 * NS_PER_S
WALK = Walker(name="Ann", path=((0.0, 0.0), (2.0, 0.0), (2.0, 1.0)), speed=1.2, start=1.0)
WALKING = 'walkers=[{name="Ann", path=[[2.0, 2.0], [2.0, -2.0]], speed=1.0}]'


def obstacle(number: int = 1, seq: int = 0, position: Vector = ORIGIN, **more: object) -> ObstacleState:
    state = ObstacleState(
        epoch=T0,
        seq=seq,
        stamp_ns=T0,
        id=number,
        position=position,
        velocity=ORIGIN,
        radius=0.3,
        height=1.8,
        valid_s=VALID_S,
    )
    return replace(state, **more)


def test_a_walker_goes_there_and_back_again_no_faster_than_it_may() -> None:
    times = np.arange(0.0, 20.0, 0.01)
    track = [walk(WALK, t) for t in times.tolist()]
    assert [position for position, _ in track[:100]] == [(0.0, 0.0, 0.0)] * 100
    places = np.array([position for position, _ in track])
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / 0.01
    assert speeds.max() == pytest.approx(WALK.speed, rel=0.01)
    said = np.array([velocity for _, velocity in track])
    assert np.abs(np.diff(places, axis=0) / 0.01 - (said[1:] + said[:-1]) / 2.0).max() < 0.01
    for corner in WALK.path:
        assert np.linalg.norm(places[:, :2] - corner, axis=1).min() < 0.01
    assert np.linalg.norm(places[times > 10.0][:, :2], axis=1).min() < 0.01, "back at the start"


def test_somebody_who_stands_is_a_walker_with_one_corner() -> None:
    assert walk(Walker(name="Bob", path=((1.0, 2.0),)), 7.0) == ((1.0, 2.0, 0.0), ORIGIN)
    with pytest.raises(ConfigError, match="path is empty"):
        structure_scenario({"walkers": [{"name": "Bob", "path": []}]}, "x")


def test_the_world_says_where_its_walkers_are_at_the_rate_of_the_topic() -> None:
    network, now = MemoryNetwork(), [T0]
    clock = lambda: now[0]  # noqa: E731
    inbox = Inbox(clock)
    MemoryBus(network).subscribe(OBSTACLE.wildcard, inbox)
    crowd = Crowd(MemoryBus(network), [WALK, WALK], clock)
    heard: dict[str, list[ObstacleState]] = {}
    for _ in range(300):
        now[0] += 10_000_000
        cylinders = crowd.step()
        for key, arrivals in inbox.take().items():
            heard.setdefault(key, []).extend(decode(each.payload, ObstacleState) for each in arrivals)
    assert sorted(heard) == ["obstacle/1", "obstacle/2"]
    states = heard["obstacle/1"]
    assert len(states) == pytest.approx(90, abs=3)
    assert [state.seq for state in states] == list(range(len(states)))
    assert cylinders[0][2:] == (0.3, 0.0, 1.8)
    assert math.hypot(*states[-1].velocity) > 0.1


def test_a_world_without_walkers_says_nothing() -> None:
    assert Crowd(MemoryBus(MemoryNetwork()), (), lambda: T0).step() == []


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"id": 2}, "wrong-id"),
        ({"seq": 0}, "out-of-order"),
        ({"position": (5.0, 0.0, 0.0)}, "jump"),
        ({"velocity": (20.0, 0.0, 0.0)}, "too-fast"),
    ],
)
def test_what_cannot_be_is_not_believed(wrong: dict[str, object], reason: str) -> None:
    watch = ObstacleWatch()
    watch.hear(1, obstacle(seq=5), T0)
    with pytest.raises(DecodeError) as refused:
        watch.hear(1, replace(obstacle(seq=6), **wrong), T0 + 33_000_000)
    assert refused.value.reason == reason
    assert [state.seq for state, _ in watch.present(T0)] == [5]


def test_an_obstacle_is_there_for_as_long_as_it_may_be_relied_on() -> None:
    watch = ObstacleWatch()
    watch.hear(1, obstacle(), T0)
    ((state, age),) = watch.present(T0 + NS_PER_S)
    assert state.id == 1
    assert age == pytest.approx(1.0)
    assert watch.present(T0 + round((VALID_S + 0.01) * NS_PER_S)) == []


def test_nobody_fills_a_listener_with_obstacles() -> None:
    watch = ObstacleWatch()
    for number in range(1, MOST_OBSTACLES + 1):
        watch.hear(number, obstacle(number), T0)
    with pytest.raises(DecodeError, match="more than"):
        watch.hear(999, obstacle(999), T0)
    later = T0 + 3 * NS_PER_S
    watch.hear(999, obstacle(999), later)
    assert [state.id for state, _ in watch.present(later)] == [999]


def test_senses_hear_obstacles_only_if_they_are_to() -> None:
    said = {OBSTACLE.key(id=1): [Arrival(encode(obstacle()), T0)]}
    deaf, hearing = Senses([2]), Senses([2], obstacles=True)
    for senses in (deaf, hearing):
        senses.take(said)
    assert deaf.rejected == {"unknown-key": 1}
    assert OBSTACLE.wildcard in hearing.keys
    assert hearing.rejected == {}
    assert [state.id for state, _ in hearing.obstacles.present(T0)] == [1]
    hearing.take({OBSTACLE.key(id=1): [Arrival(b"garbage", T0)], "obstacle/x": [Arrival(b"", T0)]})
    assert sum(hearing.rejected.values()) == 2


def test_drones_link_to_a_world_in_which_somebody_walks() -> None:
    for overrides, linked in (([], False), ([WALKING], True)):
        scenario = load_scenario("rhombus", overrides)
        formation = build_formation(scenario)
        mine = endpoint(scenario, formation, drone_node(2))
        assert (mine in dials(scenario, formation, WORLD)) is linked
    assert OBSTACLE.wildcard in writes(WORLD)
    assert OBSTACLE.wildcard not in writes(drone_node(1))


def test_columns_have_a_radius_and_a_height_of_their_own() -> None:
    scenario = load_scenario(
        "rhombus", ['obstacles=[{name="a", x=1.0, y=2.0}, {name="b", x=2.0, y=2.0, radius=0.4, height=1.0}]']
    )
    plain, low = columns_of(scenario)
    assert plain == Cylinder(1.0, 2.0, 0.12)
    assert low == Cylinder(2.0, 2.0, 0.4, high=1.0)
    assert low.gap((2.0, 2.0, 1.5)) == pytest.approx(0.5)
    assert low.gap((2.6, 2.0, 0.5)) == pytest.approx(0.2)


def met(age: float, **said: Any) -> DroneState:
    """Returns what a drone that hovers at (-0.5, 0, 1.2) does, an age after somebody on foot was heard of."""
    scenario = load_scenario("rhombus")
    formation = build_formation(scenario)
    brain = Agent(scenario, formation, 1, agent_settings(scenario, formation, 1), epoch=T0)
    pose = Pose((-0.5, 0.0, 1.2), ORIGIN, 0.0, 1.0, airborne=True, seq=1)
    brain.step(T0, pose, 0.0)
    brain.receive({OBSTACLE.key(id=1): [Arrival(encode(replace(obstacle(), **said)), T0)]})
    return brain.step(T0 + round(age * NS_PER_S) + 16_000_000, pose, 0.0)


def test_a_drone_leaves_the_way_of_whoever_walks() -> None:
    state = met(0.02, position=(-1.3, 0.0, 0.0), velocity=(1.2, 0.0, 0.0))
    assert Flag.AVOIDING in state.flags
    assert state.asked[0] > 0.5
    above = met(0.02, position=(-1.3, 0.0, 0.0), velocity=(1.2, 0.0, 0.0), height=0.5)
    assert Flag.AVOIDING not in above.flags, "it passes below"


def test_who_walked_and_is_not_heard_is_avoided_where_he_was_and_on_his_way_until_it_is_too_old() -> None:
    for place in ((-0.8, 0.0, 0.0), (-1.3, 0.0, 0.0)):
        assert Flag.AVOIDING in met(VALID_S - 0.1, position=place, velocity=(0.8, 0.0, 0.0)).flags
        assert Flag.AVOIDING not in met(VALID_S + 0.1, position=place, velocity=(0.8, 0.0, 0.0)).flags


axes = st.floats(-2.0, 2.0)
points = st.tuples(axes, axes, axes)


@given(points, points, st.floats(0.0, 1.0), st.floats(0.0, 2.0))
def test_the_gap_to_a_cylinder_is_that_to_its_nearest_point(
    point: Vector, foot: Vector, radius: float, height: float
) -> None:
    x, y, z = foot
    cylinder = Cylinder(x, y, radius, z, z + height)
    (many,) = _surface_gaps(np.array([point]), cylinder).tolist()
    assert many == pytest.approx(cylinder.gap(point))
    if cylinder.gap(point) < 0.0:
        return
    away = math.hypot(point[0] - x, point[1] - y)
    share = min(1.0, radius / away) if away else 0.0
    nearest = (x + share * (point[0] - x), y + share * (point[1] - y), min(max(point[2], z), z + height))
    assert cylinder.gap(point) == pytest.approx(math.dist(point, nearest), abs=1e-9)


def watched(*track: tuple[Vector, Sequence[Cylinder]]) -> RefereeState:
    rules = Rules(ids=(7,), columns=(), fence=((-9.0, -9.0, -1.0), (9.0, 9.0, 9.0)))
    state = RefereeState()
    for t, (position, obstacles) in enumerate(track):
        state = update(rules, state, [position], [True], hand=None, t=float(t), obstacles=obstacles)
    return state


def test_the_referee_counts_contacts_with_what_moves_once_per_episode() -> None:
    walker = Cylinder(0.0, 0.0, 0.3, 0.0, 1.8)
    track = [((0.5, 0.0, 1.0), [walker]), ((0.35, 0.0, 1.0), [walker]), ((0.3, 0.0, 1.0), [walker])]
    seen = report(watched(*track, ((0.0, 0.0, 2.5), [walker])))
    assert (seen["obstacle_contacts"], seen["collisions"]) == (1, 1)
    assert seen["min_obstacle_distance_m"] == pytest.approx(0.0)
    assert seen["min_obstacle_distance_t_s"] == 2.0
    assert seen["min_obstacle_distance_to"] == 7


def test_a_trace_shows_where_they_walked() -> None:
    scenario = load_scenario("rhombus", [WALKING])
    scene = Scene(scenario, build_formation(scenario))
    scene.add(obstacle(position=(1.0, 2.0, 0.0)))
    (entity,) = [each for each in scene.moment(0).entities if each.id == "obstacle/1"]
    (shape,) = entity.cylinders
    assert (shape.pose.position.x, shape.pose.position.z, shape.size.z) == (1.0, 0.9, 1.8)


def test_obstacles_of_a_scenario_are_numbered_from_one() -> None:
    states = obstacles_at([WALK, WALK], 3.0, epoch=1, seq=4, stamp_ns=9)
    assert [state.id for state in states] == [1, 2]
    assert {(state.epoch, state.seq, state.stamp_ns, state.valid_s) for state in states} == {(1, 4, 9, VALID_S)}
    assert cylinder_of(states[0]).high == WALK.height
