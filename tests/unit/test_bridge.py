"""The bridge's brain: what it makes of what it hears, and that nothing it hears can break it."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from glove_bridge.bridge import Bridge, Step
from glove_bridge.gloves.base import Outcome, Report
from glove_bridge.patterns import CUES, load_patterns
from shared.arrays import rest_of
from shared.codec import MAX_PAYLOAD, encode
from shared.config import load_scenario
from shared.errors import ConfigError
from shared.formation import build_formation
from shared.messages import ORIGIN, DroneState, HandSample, Heard, Mode, Vector, Wish
from shared.senses import Sensed
from shared.topics import DRONE_STATE, HAND
from shared.transport import Arrival
from tests.strategies import garbage

MS = 1_000_000
START = 1_000_000 * MS
RHOMBUS = load_scenario("rhombus")
FORMATION = build_formation(RHOMBUS)
CENTRE = (0.0, 0.0)


def make(patterns: str = "flight", scenario: Any = RHOMBUS) -> Bridge:
    return Bridge(scenario, build_formation(scenario), load_patterns(patterns), load_patterns(CUES), START)


def state(drone: int, position: Vector, seq: int, mode: Mode = Mode.FOLLOW) -> DroneState:
    goal = FORMATION.rest[FORMATION.row(drone)]
    return DroneState(
        epoch=7,
        seq=seq,
        stamp_ns=0,
        id=drone,
        position=position,
        velocity=ORIGIN,
        goal=goal,
        goal_velocity=ORIGIN,
        setpoint=position,
        mode=mode,
    )


def hear(
    bridge: Bridge,
    now_ns: int,
    *,
    scale: float = 1.0,
    shift: float = 0.0,
    drones: tuple[int, ...] = FORMATION.ids,
    mode: Mode = Mode.FOLLOW,
    wish: Wish = Wish.FLY,
) -> None:
    """The formation at rest, scaled, and shifted to the right, as it arrives at one moment."""
    seq = now_ns // MS
    hand = HandSample(epoch=3, seq=seq, stamp_ns=0, position=ORIGIN, velocity=ORIGIN, yaw=0.0, mode=wish)
    arrivals = {HAND.key(): [Arrival(encode(hand), now_ns)]}
    rest = rest_of(FORMATION)
    centre = rest.mean(axis=0)
    for drone in drones:
        place = centre + scale * (rest[FORMATION.row(drone)] - centre)
        x, y, z = place.tolist()
        message = state(drone, (x, y + shift, z), seq, mode)
        arrivals[DRONE_STATE.key(id=drone)] = [Arrival(encode(message), now_ns)]
    bridge.receive(arrivals)


def played(step: Step) -> str | None:
    return step.play.name if step.play else None


def test_before_anybody_is_heard_everybody_is_missing_and_nothing_plays() -> None:
    bridge = make()
    step = bridge.step(START)
    assert step.state.missing == (1, 2, 3, 4)
    assert (step.state.area, step.state.distances, step.state.heard) == (0.0, {}, {})
    assert step.play is None


def test_the_state_of_the_formation_names_its_inputs() -> None:
    bridge = make()
    hear(bridge, START)
    found = bridge.step(START + MS).state
    assert found.area == pytest.approx(0.5)
    assert found.area_ratio == pytest.approx(1.0)
    assert set(found.distances) == {"1-2", "1-3", "2-4", "3-4"}
    assert (found.extent, found.trend, found.missing) == (0, 0, ())
    assert set(found.heard) == {"human/hand", *(f"drone/{i}/state" for i in (1, 2, 3, 4))}
    assert found.heard["drone/3/state"] == Heard(7, START // MS, START)


def test_a_state_becomes_a_pattern_and_the_event_says_why() -> None:
    bridge = make()
    hear(bridge, START, scale=0.8, shift=0.2)
    step = bridge.step(START + MS)
    assert played(step) == "CR"
    bridge.state_published()
    begun = bridge.reported(Report(Outcome.STARTED, START + 2 * MS), START + 2 * MS)
    done = bridge.reported(Report(Outcome.FINISHED, START + 302 * MS), START + 303 * MS)
    assert begun
    assert done
    assert (begun.pattern, begun.outcome, begun.state_seq) == ("CR", "started", step.state.seq)
    assert (begun.started_ns, begun.finished_ns) == (START + 2 * MS, 0)
    assert set(begun.heard) == {"human/hand", "drone/1/state"}
    assert (done.outcome, done.started_ns, done.finished_ns) == ("finished", START + 2 * MS, START + 302 * MS)
    assert (begun.seq, done.seq) == (0, 1)
    assert bridge.step(START + 400 * MS).state.seq == step.state.seq + 1


def test_what_is_missed_is_told_with_the_state_that_called_for_it() -> None:
    bridge = make()
    hear(bridge, START, scale=0.8, shift=0.2)
    bridge.step(START)
    bridge.reported(Report(Outcome.STARTED, START), START)
    bridge.state_published()
    hear(bridge, START + 100 * MS, scale=0.8, shift=-0.2)
    assert bridge.step(START + 100 * MS).play is None
    bridge.reported(Report(Outcome.FINISHED, START + 300 * MS), START + 300 * MS)
    hear(bridge, START + 900 * MS)
    (event,) = bridge.step(START + 900 * MS).events
    assert (event.pattern, event.outcome, event.state_seq) == ("CL", "suppressed", 1)
    assert bridge.counts[Outcome.SUPPRESSED] == 1


@pytest.mark.parametrize("mode", [Mode.GROUND, Mode.TAKEOFF, Mode.LAND, Mode.STOP])
def test_a_formation_that_is_not_formed_is_not_felt(mode: Mode) -> None:
    bridge = make()
    hear(bridge, START, scale=0.8, shift=0.2, mode=mode)
    step = bridge.step(START)
    assert step.state.extent == -1
    assert step.play is None


def test_a_silent_drone_is_missing_and_the_others_are_compared_with_their_own_default() -> None:
    bridge = make("paper")
    hear(bridge, START)
    bridge.step(START)
    hear(bridge, START + 600 * MS, drones=(1, 2, 3))
    step = bridge.step(START + 600 * MS)
    assert step.state.missing == (4,)
    assert step.state.extent == 0
    assert step.state.area_ratio == pytest.approx(1.0)
    assert "drone/4/state" not in step.state.heard
    assert played(step) == "DRONE_LOST"
    event = bridge.reported(Report(Outcome.STARTED, START + 601 * MS), START + 601 * MS)
    assert event
    assert set(event.heard) == {"drone/4/state"}


def test_lost_presence_is_quicker_than_silence_until_it_is_heard_again() -> None:
    bridge = make()
    hear(bridge, START)
    bridge.presence_changed("drone/2", True, START + MS)
    bridge.presence_changed("relay/0", False, START + MS)
    assert bridge.step(START + 2 * MS).state.missing == ()
    bridge.presence_changed("drone/2", False, START + 3 * MS)
    step = bridge.step(START + 3 * MS)
    assert (step.state.missing, played(step)) == ((2,), "DRONE_LOST")
    hear(bridge, START + 5 * MS)
    assert bridge.step(START + 5 * MS).state.missing == ()


def test_a_silent_hand_is_felt_before_the_formation() -> None:
    bridge = make()
    hear(bridge, START, scale=0.8, shift=0.2)
    bridge.step(START)
    bridge.reported(Report(Outcome.FAILED, START), START)
    hands = bridge.senses.hand
    for now in range(START, START + 900 * MS, 16 * MS):
        hear(bridge, now, scale=0.8, shift=0.2)
        bridge.senses.hand = hands
        name = played(bridge.step(now))
        if name:
            assert name == "HAND_STALE"
            assert 250 < (now - START) / MS < 250 + 17
            return
    raise AssertionError("nothing was felt")


def test_a_hand_that_has_jumped_is_felt_as_one_that_is_silent() -> None:
    bridge = make()
    hear(bridge, START)
    bridge.step(START)
    hand = bridge.senses.hand
    assert hand is not None
    bridge.senses.hand = Sensed(replace(hand.message, jumped=True), START)
    assert played(bridge.step(START + 500 * MS)) == "HAND_STALE"


def test_states_of_different_age_do_not_deform_a_moving_formation() -> None:
    bridge = make("paper")
    hear(bridge, START)
    late = START + 200 * MS
    for drone in (1, 2):
        moving = replace(state(drone, ORIGIN, 1), velocity=(1.0, 0.0, 0.0), epoch=8)
        x, y, z = FORMATION.rest[FORMATION.row(drone)]
        bridge.receive(
            {DRONE_STATE.key(id=drone): [Arrival(encode(replace(moving, position=(x, y, z))), START)]}
        )
    for drone in (3, 4):
        x, y, z = FORMATION.rest[FORMATION.row(drone)]
        moved = replace(state(drone, (x + 0.2, y, z), 1), velocity=(1.0, 0.0, 0.0), epoch=8)
        bridge.receive({DRONE_STATE.key(id=drone): [Arrival(encode(moved), late)]})
    found = bridge.step(late).state
    assert found.area_ratio == pytest.approx(1.0)
    assert (found.extent, found.trend) == (0, 0)


def test_stop_silences_the_glove() -> None:
    bridge = make()
    hear(bridge, START, scale=0.8, shift=0.2, wish=Wish.STOP)
    step = bridge.step(START)
    assert step.stop
    assert step.play is None


def test_a_report_of_nothing_is_no_event() -> None:
    assert make().reported(Report(Outcome.FINISHED, START), START) is None


def test_every_set_flies_and_cues_alone_are_refused() -> None:
    for name in ("paper", "distinct", "flight", "flight-2018"):
        hear(bridge := make(name), START, scale=0.8, shift=0.2)
        assert bridge.step(START).state.missing == ()
    with pytest.raises(ConfigError, match="choose one that means 'state' or 'advice'"):
        make("cues")


@pytest.mark.parametrize(("count", "named"), [(32, 32), (64, 1)])
def test_the_state_of_a_large_swarm_fits_into_a_payload(count: int, named: int) -> None:
    scenario = load_scenario("grid", [f"formation.n={count}"])
    bridge = make("paper", scenario)
    for row, (x, y, z) in enumerate(build_formation(scenario).rest):
        message = replace(state(1, (x, y, z), 2**40), id=row + 1, epoch=2**62)
        bridge.receive({DRONE_STATE.key(id=row + 1): [Arrival(encode(message), 2**62)]})
    found = bridge.step(2**62).state
    assert len(encode(found)) <= MAX_PAYLOAD
    assert len(found.heard) == named


GARBAGE = st.tuples(st.just(HAND.key()), garbage(HandSample)) | st.tuples(
    st.sampled_from([DRONE_STATE.key(id=drone) for drone in (1, 2, 3, 4, 5)]), garbage(DroneState)
)


@given(st.lists(GARBAGE, max_size=20))
def test_garbage_is_counted_and_changes_nothing(messages: list[tuple[str, bytes]]) -> None:
    bridge = make()
    hear(bridge, START)
    before = bridge.step(START + MS)
    for key, payload in messages:
        bridge.receive({key: [Arrival(payload, START + MS)]})
    assert bridge.senses.rejected.total() == len(messages)
    assert bridge.step(START + MS) == before
