"""One control step of one drone: what it follows, holds, extrapolates and reports (agents/control/step.py)."""

import functools
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.agent import Agent
from agents.control.hand import HandInput
from agents.control.repair import EXTRAPOLATION, Reference
from agents.control.safety.encounter import Clearance, Encounter, drone_heard
from agents.control.step import Inputs, Output, Settings, State, start, step
from agents.settings import agent_settings
from agents.vehicles.base import Pose
from shared.clock import NS_PER_S
from shared.codec import encode
from shared.config import load_scenario
from shared.formation import build_formation
from shared.messages import NO_HAND, ORIGIN, Flag, HandSample, Mode, Vector, Wish
from shared.topics import HAND
from shared.transport import Arrival
from tests.values import replace, vector

Triple = Sequence[float]

TICK = 1.0 / 60.0
CLEARANCE = Clearance(0.3, 1.0, 3.0)
NEVER = math.inf
REST = {1: (-0.5, 0.0, 1.2), 2: (-1.0, 0.5, 1.2), 3: (-1.0, -0.5, 1.2), 4: (-1.5, 0.0, 1.2)}
"""The rhombus in the air with the hand at (0, 0, 1.2)."""


@functools.cache
def settings(drone: int, *overrides: str) -> Settings:
    scenario = load_scenario("rhombus", overrides)
    return agent_settings(scenario, build_formation(scenario), drone)


def hand(x: float = 0.0, y: float = 0.0, velocity: Triple = (0, 0, 0), stamp: float = 0.0) -> HandInput:
    return HandInput(position=(x, y, 1.2), velocity=vector(velocity), yaw=0.0, stamp=stamp)


def reference(point: Triple, **changes: Any) -> Reference:
    known = Reference(
        point=vector(point), velocity=ORIGIN, goal_velocity=ORIGIN, mode=Mode.FOLLOW, age=0.0, fresh=True
    )
    return replace(known, **changes)


def drones(*places: Triple) -> list[Encounter]:
    return [drone_heard(vector(place), ORIGIN, ORIGIN, 0.0, CLEARANCE, yields=True) for place in places]


def said(output: Output) -> Flag:
    return Flag(output.flags)


def inputs(drone: int, **changes: Any) -> Inputs:
    """Everybody hovers in the rhombus, everything is heard."""
    calm = Inputs(
        position=REST[drone],
        velocity=ORIGIN,
        pose_age=0.0,
        battery=1.0,
        hand=hand(),
        wish=Wish.FLY,
        hand_age=0.0,
        hand_fresh=True,
        references=[reference(REST[other]) for other in {1: (), 2: (1,), 3: (1,), 4: (2, 3)}[drone]],
        drones=drones(),
        obstacles=[],
        missed=False,
        awaiting=False,
        alone=False,
    )
    now = replace(calm, **changes)
    # Drone 4 knows its ancestor, drone 1, too.
    return replace(now, references=[*now.references, *([reference(REST[1])] if drone == 4 else [])])


def hovering(drone: int, rules: Settings) -> State:
    """In FOLLOW, at rest in its place."""
    state, output = step(start(REST[drone], rules, airborne=True), inputs(drone), rules, TICK)
    assert state.mode.mode is Mode.FOLLOW
    assert output.setpoint == pytest.approx(REST[drone])
    return state


def towards(position: Vector, setpoint: Vector, share: float) -> Vector:
    return vector([x + (goal - x) * share for x, goal in zip(position, setpoint, strict=True)])


def repeat(state: State, now: Inputs, rules: Settings, seconds: float) -> tuple[State, Output]:
    for _ in range(round(seconds / TICK)):
        state, output = step(state, now, rules, TICK)
    return state, output


def moved_links(drone: int, rules: Settings) -> State:
    """In FOLLOW after the hand has moved for half a second; the links are displaced."""
    state = hovering(drone, rules)
    for k in range(1, 31):
        moving = hand(-0.6 * k * TICK, velocity=(-0.6, 0, 0), stamp=k * TICK)
        state, _ = step(state, inputs(drone, hand=moving), rules, TICK)
    assert min(abs(link.displacement[0]) for link in state.links) > 0.05
    return state


def test_following_takes_the_goal_from_hand_references_and_links() -> None:
    rules = settings(4)
    references = [reference((-1.1, 0.6, 1.2)), reference((-1.2, -0.3, 1.2))]
    _, output = step(hovering(4, rules), inputs(4, references=references), rules, TICK)
    assert output.goal == pytest.approx([-1.65, 0.15, 1.2])
    assert said(output) == Flag(0)


@pytest.mark.parametrize(("height_from", "height"), [("hand", 1.2), ("references", 1.5)])
def test_the_height_of_a_reference_is_its_own_or_the_hands(height_from: str, height: float) -> None:
    rules = settings(2, f"formation.height_from={height_from}")
    _, output = step(hovering(2, rules), inputs(2, references=[reference((-0.5, 0.0, 1.5))]), rules, TICK)
    assert output.goal == pytest.approx([-1.0, 0.5, height])


def test_hold_relaxes_the_links_freezes_the_hand_and_keeps_following_the_references() -> None:
    rules = settings(2)
    state = moved_links(2, rules)
    assert state.hand is not None
    where = state.hand.point
    for k in range(180):
        drifting = reference((-0.5 - 0.1 * k * TICK, 0.0, 1.2), mode=Mode.HOLD)
        runaway = hand(5.0, velocity=(1, 0, 0), stamp=1.0 + k * TICK)
        held = inputs(2, hand=runaway, wish=Wish.HOLD, references=[drifting])
        state, output = step(state, held, rules, TICK)
    assert state.mode.mode is Mode.HOLD
    assert max(abs(x) for link in state.links for x in link.displacement) < 0.002
    assert state.hand is not None
    assert state.hand.point == where
    assert state.hand.velocity == (0.0, 0.0, 0.0)
    assert output.goal == pytest.approx(np.add(drifting.point, (-0.5, 0.5, 0.0)), abs=0.002)
    assert Flag.REFERENCE_LOST not in said(output)


@pytest.mark.parametrize("mode", [Mode.GROUND, Mode.TAKEOFF])
def test_until_its_reference_has_joined_a_drone_holds_its_own_position(mode: Mode) -> None:
    lost = reference(REST[1], mode=mode)
    rules = settings(2)
    blown = (REST[2][0] + 0.2, *REST[2][1:])
    state, _ = step(hovering(2, rules), inputs(2, position=blown), rules, TICK)
    place = state.trajectory.point
    state, output = repeat(state, inputs(2, position=blown, references=[lost]), rules, 3.0)
    assert state.mode.mode is Mode.HOLD
    assert output.goal == place
    assert output.setpoint == pytest.approx(place)
    assert Flag.REFERENCE_LOST in said(output)
    # Within its patience the reference is followed, however old.
    known = reference((-0.7, 0.0, 1.2), age=0.49, fresh=False)
    state, output = step(state, inputs(2, references=[known]), rules, TICK)
    assert (state.mode.mode, Flag.REFERENCE_LOST in said(output)) == (Mode.FOLLOW, False)
    assert output.goal == pytest.approx([-1.2, 0.5, 1.2])


@pytest.mark.parametrize(
    ("velocity", "age", "way"),
    [
        ((1.0, 0.0, 0.0), 0.1, (0.1, 0.0, 0.0)),
        ((0.0, -0.5, 0.0), 0.4, (0.0, -0.2, 0.0)),
        ((1.0, 0.0, 0.0), 0.3, (0.25, 0.0, 0.0)),
        ((-30.0, 40.0, 0.0), 0.5, (-0.15, 0.20, 0.0)),
    ],
)
def test_a_silent_reference_is_extrapolated_within_its_bound(velocity: Triple, age: float, way: Triple) -> None:
    rules = settings(2)
    silent = reference(REST[1], velocity=vector(velocity), age=age, fresh=False)
    _, output = step(hovering(2, rules), inputs(2, references=[silent]), rules, TICK)
    assert np.subtract(output.goal, REST[2]) == pytest.approx(way)
    assert said(output) == Flag.EXTRAPOLATING
    heard = replace(silent, fresh=True)
    _, output = step(hovering(2, rules), inputs(2, references=[heard]), rules, TICK)
    assert output.goal == pytest.approx(REST[2])
    assert said(output) == Flag(0)


@given(
    velocity=st.tuples(*[st.floats(-50.0, 50.0)] * 3),
    age=st.floats(0.0, 0.5),
    law=st.sampled_from(["paper", "stable"]),
)
def test_no_silence_moves_a_goal_further_than_the_bound(velocity: Triple, age: float, law: str) -> None:
    rules = settings(2, f"swarm.law={law}", "formation.height_from=references")
    silent = reference(REST[1], velocity=vector(velocity), age=age, fresh=False)
    _, output = step(hovering(2, rules), inputs(2, references=[silent]), rules, TICK)
    assert math.dist(output.goal, REST[2]) <= EXTRAPOLATION + 1e-9


@pytest.mark.parametrize(("age", "stale"), [(0.24, False), (0.26, True)])
def test_a_silent_hand_no_longer_moves_anything(age: float, stale: bool) -> None:
    rules = settings(1)
    state, output = step(moved_links(1, rules), inputs(1, hand_age=age, hand_fresh=False), rules, TICK)
    assert state.mode.mode is Mode.FOLLOW
    assert state.hand is not None
    assert any(state.hand.velocity) != stale
    assert (Flag.HAND_STALE in said(output)) is stale


def test_a_silent_hand_is_no_longer_coming_closer() -> None:
    rules, position = settings(1), REST[1]
    state = hovering(1, rules)
    silent = inputs(1, hand=hand(velocity=(-1.5, 0, 0)), hand_age=2.0, hand_fresh=False)
    for _ in range(600):
        state, output = step(state, replace(silent, position=position), rules, TICK)
        position = towards(position, output.setpoint, TICK / 0.3)
    assert math.dist(position, output.goal) < 0.05


def test_a_hand_that_returns_elsewhere_is_met_at_its_limited_speed() -> None:
    rules = settings(1, "hand.max_speed=0.75")
    state, _ = repeat(hovering(1, rules), inputs(1, hand_age=0.5, hand_fresh=False), rules, 0.5)
    for k in range(1, 61):
        state, _ = step(state, inputs(1, hand=hand(0.0, 2.0, stamp=0.5 + k * TICK)), rules, TICK)
    assert state.hand is not None
    # The silence itself grants a tenth of a second.
    assert state.hand.point[1] == pytest.approx(0.75 * (0.1 + 59 * TICK))


def test_the_mapped_hand_depends_on_the_samples_and_not_on_the_steps() -> None:
    rules = settings(1)
    often, seldom = hovering(1, rules), hovering(1, rules)
    for k in range(1, 60):
        sample = hand(-1.0, 1.0, stamp=k * TICK)
        often, _ = step(often, inputs(1, hand=sample), rules, 0.007)
        often, _ = step(often, inputs(1, hand=sample, hand_fresh=False, hand_age=0.01), rules, 0.009)
        seldom, _ = step(seldom, inputs(1, hand=sample), rules, 0.02)
    assert often.hand is not None
    assert seldom.hand is not None
    assert 0.5 < math.dist(often.hand.point, (0.0, 0.0, 1.2)) < 0.75
    assert often.hand.point == seldom.hand.point


def test_the_links_feel_the_hand_in_the_frame_of_the_formation() -> None:
    """Turned by a quarter, a hand that moves along y moves the formation's own x."""
    rules = settings(1)
    state, turned = hovering(1, rules), (0.0, -0.5, 1.2)
    for k in range(1, 31):
        moving = replace(hand(0.0, -0.6 * k * TICK, velocity=(0, -0.6, 0), stamp=k * TICK), yaw=math.pi / 2)
        first = replace(state, hand=None) if k == 1 else state
        state, output = step(first, inputs(1, hand=moving, position=turned), rules, TICK)
    assert state.links[0].displacement[0] > 0.05
    assert state.links[0].displacement[1:] == pytest.approx((0.0, 0.0))
    assert output.goal == pytest.approx([0.0, -0.3 - 0.5 - state.links[0].displacement[0], 1.2])


@pytest.mark.parametrize("wish", [wish for wish in Wish if wish is not Wish.FLY])
def test_only_a_hand_that_wants_to_fly_is_taken_on(wish: Wish) -> None:
    rules = settings(1)
    grounded = (-0.5, 0.0, 0.0)
    state, _ = step(
        start(grounded, rules, airborne=False), inputs(1, wish=wish, position=grounded), rules, TICK
    )
    assert state.hand is None
    state, _ = step(state, inputs(1, hand=hand(0.3, 0.1, velocity=(1, 0, 0)), position=grounded), rules, TICK)
    if wish is not Wish.STOP:
        assert state.hand is not None
        assert state.hand.point == (0.3, 0.1, 1.2)
        assert not any(state.hand.velocity)


def test_it_climbs_and_descends_at_its_rates_where_it_stands() -> None:
    rules = settings(2, "limits.takeoff_speed=0.4", "limits.landing_speed=0.2")
    alone = {"references": [None], "position": (-1.0, 0.5, 0.0)}
    state = start((-1.0, 0.5, 0.0), rules, airborne=False)
    state, output = repeat(state, inputs(2, **alone), rules, 1.0)
    assert state.mode.mode is Mode.TAKEOFF
    assert output.goal == pytest.approx([-1.0, 0.5, 0.4])
    _, output = repeat(state, inputs(2, **alone), rules, 5.0)
    assert output.goal == pytest.approx([-1.0, 0.5, 1.2])
    state, output = repeat(hovering(2, rules), inputs(2, wish=Wish.LAND), rules, 1.0)
    assert state.mode.mode is Mode.LAND
    assert output.goal == pytest.approx([-1.0, 0.5, 1.0])
    _, output = repeat(state, inputs(2, wish=Wish.LAND), rules, 9.0)
    assert output.goal == pytest.approx([-1.0, 0.5, 0.0])


@pytest.mark.parametrize("wish", [Wish.GROUND, Wish.STOP])
def test_on_the_ground_the_set_point_is_the_body(wish: Wish) -> None:
    rules = settings(1)
    state = start((-0.5, 0.0, 0.0), rules, airborne=False)
    carried = (-0.7, 0.2, 0.0)
    state, _ = repeat(state, inputs(1, wish=wish, position=(-0.5, 0.0, 0.0)), rules, 0.1)
    _, output = step(state, inputs(1, wish=wish, position=carried), rules, TICK)
    assert output.setpoint == output.goal == carried


def test_blocked_is_said_after_two_seconds_of_not_arriving_and_no_longer_on_arrival() -> None:
    rules = settings(1)
    held = inputs(1, position=(-0.5, 0.35, 1.2))
    state, output = repeat(hovering(1, rules), held, rules, 1.9)
    assert Flag.BLOCKED not in said(output)
    state, output = repeat(state, held, rules, 0.2)
    assert Flag.BLOCKED in said(output)
    state, output = step(state, inputs(1, position=(-0.5, 0.25, 1.2)), rules, TICK)
    assert Flag.BLOCKED not in said(output)
    _, output = repeat(state, held, rules, 1.9)
    assert Flag.BLOCKED not in said(output)


def test_who_holds_is_not_blocked() -> None:
    rules = settings(1)
    held = inputs(1, position=(-0.5, 0.5, 1.2), wish=Wish.HOLD)
    assert Flag.BLOCKED not in said(repeat(hovering(1, rules), held, rules, 3.0)[1])


def test_the_fence_is_reported_and_kept() -> None:
    rules = settings(2, "fence.min=[-1.2, -1.0, -0.1]", "fence.max=[1.0, 1.0, 3.0]")
    outside = inputs(2, references=[reference((-1.5, 0.0, 1.2))])
    _, output = repeat(hovering(2, rules), outside, rules, 3.0)
    assert output.goal == pytest.approx([-2.0, 0.5, 1.2])
    assert output.setpoint == pytest.approx([-1.05, 0.5, 1.2])
    assert said(output) & Flag.FENCE


@pytest.mark.parametrize(
    "near", [{"drones": drones((-0.7, 0.0, 1.2))}, {"hand": hand(-0.3)}], ids=["a drone", "the hand"]
)
def test_who_comes_near_is_avoided(near: dict[str, Any]) -> None:
    rules = settings(1)
    _, output = step(hovering(1, rules), inputs(1, **near), rules, TICK)
    assert said(output) == Flag.AVOIDING
    assert math.dist(output.setpoint, REST[1]) > 1e-3


def hear(brain: Agent, now_ns: int, seq: int, position: Vector, wish: Wish) -> None:
    sample = HandSample(
        epoch=0, seq=seq, stamp_ns=now_ns, position=position, velocity=ORIGIN, yaw=0.0, mode=wish
    )
    brain.receive({HAND.key(): [Arrival(encode(sample), now_ns)]})


@pytest.mark.parametrize("wish", [Wish.HOLD, Wish.FLY])
def test_no_hand_is_neither_followed_nor_avoided(wish: Wish) -> None:
    """`NO_HAND` lies right below (0, 0), and the hand is avoided in the plane."""
    scenario = load_scenario("rhombus")
    pose = Pose((0.05, 0.0, 1.2), ORIGIN, 0.0, 1.0, airborne=True, seq=1)
    for position, avoids in ((NO_HAND, False), ((0.0, 0.0, 1.2), True)):
        brain = Agent(scenario, build_formation(scenario), 1, settings(1), epoch=0)
        for k in range(1, 61):
            now = k * NS_PER_S // 60
            hear(brain, now, k, position, wish)
            published = brain.step(now, pose, 0.0)
        assert (Flag.AVOIDING in published.flags) is avoids
        if not avoids:
            assert published.setpoint == published.goal == pose.position


def test_a_relay_that_lost_its_hand_leaves_the_formation_where_it_is() -> None:
    scenario = load_scenario("rhombus")
    pose = Pose((-0.3, 0.1, 1.2), ORIGIN, 0.0, 1.0, airborne=True, seq=1)
    brain = Agent(scenario, build_formation(scenario), 1, settings(1), epoch=0)
    for k in range(1, 121):
        now = k * NS_PER_S // 60
        known = k <= 60
        hear(brain, now, k, (0.2, 0.1, 1.2) if known else NO_HAND, Wish.FLY if known else Wish.HOLD)
        published = brain.step(now, pose, 0.0)
        assert published.goal == pytest.approx(pose.position)
    assert published.mode is Mode.HOLD


coordinates = st.floats(-2.0, 2.0)
places = st.tuples(*[st.floats(-1_000.0, 1_000.0)] * 3) | st.tuples(*[st.floats(-2.0, 2.0)] * 3)
speeds = st.tuples(*[st.floats(-50.0, 50.0)] * 3)
ages = st.sampled_from([0.0, 0.0, 0.1, 0.3, 0.6, 1.5, 11.0])
references = st.none() | st.builds(
    Reference,
    point=places,
    velocity=speeds,
    goal_velocity=speeds,
    mode=st.sampled_from([Mode.FOLLOW, *Mode]),
    age=ages,
    fresh=st.booleans(),
)
moments = st.fixed_dictionaries(
    {
        "velocity": speeds,
        "pose_age": ages,
        "battery": st.floats(0.0, 1.0),
        "hand": st.none()
        | st.builds(
            HandInput,
            position=places,
            velocity=speeds,
            yaw=st.floats(-1_000.0, 1_000.0),
            stamp=st.floats(0.0, 1e6),
        ),
        "wish": st.sampled_from([Wish.FLY, Wish.FLY, Wish.FLY, Wish.HOLD, Wish.LAND, Wish.STOP]),
        "hand_age": ages,
        "hand_fresh": st.booleans(),
        "references": st.lists(references, min_size=3, max_size=3),
        "drones": st.lists(places, max_size=3).map(lambda found: drones(*found)),
        "obstacles": st.just([]),
        "missed": st.booleans(),
        "awaiting": st.booleans(),
        "alone": st.booleans(),
    }
)
stays = st.tuples(moments, st.sampled_from([1e-9, 0.008, TICK, 0.1, 30.0]), st.integers(1, 4))


def outputs(
    rules: Settings, stays: list[tuple[dict[str, Any], float, int]], airborne: bool
) -> Iterator[Output]:
    """A body that goes half-way to its set-point in every step."""
    position = (-1.5, 0.0, 1.2 if airborne else 0.0)
    state = start(position, rules, airborne=airborne)
    for moment, dt, times in stays:
        for _ in range(times):
            state, output = step(state, Inputs(position=position, **moment), rules, dt)
            position = towards(position, output.setpoint, 0.5)
            yield output


@pytest.mark.parametrize("law", ["paper", "stable"])
@given(stays=st.lists(stays, min_size=1, max_size=8), airborne=st.booleans())
def test_whatever_happens_the_set_point_is_finite_and_inside_the_fence(
    law: str, stays: list[tuple[dict[str, Any], float, int]], airborne: bool
) -> None:
    rules = settings(4, f"swarm.law={law}", "fence.min=[-3, -2, -0.1]", "fence.max=[2, 2, 2.5]")
    for output in outputs(rules, stays, airborne):
        assert np.greater_equal(output.setpoint, [-2.85, -1.85, -0.1]).all()
        assert np.less_equal(output.setpoint, [1.85, 1.85, 2.35]).all()
        assert np.isfinite([*output.goal, *output.goal_velocity]).all()
