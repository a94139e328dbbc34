"""The agent without its process: bytes and time in, state out; and the loop around it."""

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from agents.agent import Agent
from agents.company import SETTLING
from agents.control.modes import HAND_LAND, MISSED_HOLD, MISSED_LAND
from agents.loop import Mouth, PoseWatch, command, run
from agents.near_links import NearLinks
from agents.settings import agent_settings
from agents.vehicles.base import Pose
from shared.clock import NS_PER_S
from shared.codec import decode, encode
from shared.config import load_scenario
from shared.formation import build_formation
from shared.memory_bus import MemoryBus, MemoryNetwork
from shared.messages import (
    NO_HAND,
    ORIGIN,
    DroneState,
    Flag,
    HandSample,
    Heard,
    Mode,
    ProcessStatus,
    Vector,
    Wish,
)
from shared.process import StatusReporter
from shared.topics import DRONE_STATE, HAND, PLACES, STATUS
from shared.transport import Arrival, Inbox
from tests.strategies import MESSAGES

MS = 1_000_000
T0 = 1_800_000_000 * NS_PER_S
SCENARIO = load_scenario("rhombus")
FORMATION = build_formation(SCENARIO)
GROUNDED = Pose((-0.5, 0.0, 0.0), ORIGIN, 0.0, 0.9, airborne=False, seq=1)
FLYING = Pose((-0.5, 0.0, 1.2), ORIGIN, 0.0, 0.9, airborne=True, seq=1)
HEARD_HAND, TWO, THREE = HAND.key(), DRONE_STATE.key(id=2), DRONE_STATE.key(id=3)


def agent(drone: int) -> Agent:
    return Agent(SCENARIO, FORMATION, drone, agent_settings(SCENARIO, FORMATION, drone), epoch=T0)


def hand(seq: int, position: Vector = (0.0, 0.0, 1.2), wish: Wish = Wish.FLY, epoch: int = T0) -> HandSample:
    return HandSample(
        epoch=epoch,
        seq=seq,
        stamp_ns=epoch + round(seq * NS_PER_S / 60),
        position=position,
        velocity=ORIGIN,
        yaw=0.0,
        mode=wish,
    )


def state(drone: int, seq: int, mode: Mode = Mode.FOLLOW, position: Vector = (-1.0, 0.5, 1.2)) -> DroneState:
    return DroneState(
        epoch=T0,
        seq=seq,
        stamp_ns=T0,
        id=drone,
        position=position,
        velocity=ORIGIN,
        goal=position,
        goal_velocity=ORIGIN,
        setpoint=position,
        mode=mode,
    )


def hear(brain: Agent, at: int, *messages: HandSample | DroneState) -> None:
    for message in messages:
        key = HAND.key() if isinstance(message, HandSample) else DRONE_STATE.key(id=message.id)
        brain.receive({key: [Arrival(encode(message), at)]})


def test_alone_on_the_ground_it_says_so_and_steps_ten_times_a_second() -> None:
    brain = agent(1)
    first = brain.step(T0, GROUNDED, 0.0)
    assert (first.id, first.epoch, first.seq, first.step_ns) == (1, T0, 0, T0)
    assert (first.mode, first.heard, first.goal) == (Mode.GROUND, {}, GROUNDED.position)
    assert (first.position, first.battery) == (GROUNDED.position, 0.9)
    assert first.displacements == {"human-1": ORIGIN}
    assert brain.due(T0) == (T0 + 100 * MS, [HAND.key()])
    assert brain.step(T0 + 100 * MS, GROUNDED, 0.02).seq == 1


def test_who_rests_steps_for_the_hand_alone_and_at_once() -> None:
    brain = agent(4)
    hear(brain, T0, *(state(drone, 0, Mode.GROUND) for drone in (1, 2, 3)))
    brain.step(T0, GROUNDED, 0.0)
    now = T0 + 50 * MS
    hear(brain, now, *(state(drone, 1, Mode.GROUND) for drone in (1, 2, 3)))
    assert brain.due(now).at_ns == T0 + 100 * MS, "its references do not wake it"
    hear(brain, now, hand(0, wish=Wish.GROUND))
    assert brain.due(now).at_ns == T0 + 8_333_333
    brain.step(now, GROUNDED, 0.0)
    assert brain.due(now).at_ns == now + 25 * MS, "with a hand it keeps pace"
    silent = now + 260 * MS
    assert brain.due(silent) == (now + 100 * MS, [HAND.key()])


def test_in_the_air_it_steps_at_its_own_rate_without_a_hand() -> None:
    brain = agent(1)
    brain.step(T0, FLYING, 0.0)
    assert brain.due(T0).at_ns == T0 + 25 * MS


def test_it_takes_off_when_the_hand_wants_to_fly_and_everybody_is_heard() -> None:
    brain = agent(1)
    hear(brain, T0, hand(0))
    alone = brain.step(T0, GROUNDED, 0.0)
    assert (alone.mode, alone.unheard) == (Mode.GROUND, (2, 3, 4))
    assert Flag.WAITING in alone.flags
    hear(brain, T0 + MS, *(state(other, 0, Mode.GROUND) for other in (2, 3)))
    waiting = brain.step(T0 + MS, GROUNDED, 0.0)
    assert (waiting.mode, waiting.unheard) == (Mode.GROUND, (4,))
    hear(brain, T0 + 2 * MS, state(4, 0, Mode.GROUND))
    ready = brain.step(T0 + 2 * MS, GROUNDED, 0.0)
    assert (ready.mode, ready.unheard) == (Mode.TAKEOFF, ())
    assert Flag.WAITING not in ready.flags


def test_it_stays_on_the_ground_while_somebody_does_not_hear_it() -> None:
    brain = agent(1)
    deaf = replace(state(4, 0, Mode.GROUND), unheard=(1,))
    hear(brain, T0, hand(0), state(2, 0, Mode.GROUND), state(3, 0, Mode.GROUND), deaf)
    assert brain.step(T0, GROUNDED, 0.0).mode is Mode.GROUND


def test_whom_nobody_hears_holds_where_it_is_and_lands_before_it_is_forgotten() -> None:
    brain = agent(1)
    modes: dict[Mode, float] = {}
    held: set[Vector] = set()
    for tick in range(700):
        now = T0 + tick * 16 * MS
        deaf = replace(state(2, tick), unheard=(1,) if tick >= 60 else ())
        hear(brain, now, hand(tick, (0.001 * tick, 0.0, 1.2)), deaf, state(3, tick), state(4, tick))
        told = brain.step(now, FLYING, 0.0)
        modes.setdefault(told.mode, (now - T0) / NS_PER_S)
        if told.mode is Mode.HOLD:
            held.add(told.goal)
    assert list(modes) == [Mode.FOLLOW, Mode.HOLD, Mode.LAND]
    assert len(held) == 1
    assert modes[Mode.HOLD] == pytest.approx(0.96 + MISSED_HOLD, abs=0.04)
    assert modes[Mode.LAND] == pytest.approx(0.96 + MISSED_LAND, abs=0.04)
    assert Flag.MISSED in told.flags


@pytest.mark.parametrize("wish", [Wish.GROUND, Wish.HOLD, Wish.LAND])
def test_it_stays_on_the_ground_otherwise(wish: Wish) -> None:
    brain = agent(1)
    hear(brain, T0, hand(0, wish=wish))
    assert brain.step(T0, GROUNDED, 0.0).mode is Mode.GROUND


def test_a_restarted_agent_reads_its_pose_and_holds_where_it_is() -> None:
    brain = agent(4)
    held = brain.step(T0, FLYING, 0.0)
    assert held.mode is Mode.HOLD
    assert held.goal == held.setpoint == FLYING.position
    assert Flag.REFERENCE_LOST in held.flags


def test_it_rejoins_when_hand_and_references_are_there() -> None:
    brain = agent(4)
    brain.step(T0, FLYING, 0.0)
    hear(brain, T0, hand(0), state(1, 5, position=(-0.5, 0.0, 1.2)))
    hear(brain, T0, state(2, 5, position=(-1.0, 0.5, 1.2)), state(3, 5, position=(-1.0, -0.5, 1.2)))
    joined = brain.step(T0 + 10 * MS, FLYING, 0.0)
    assert joined.mode is Mode.FOLLOW
    assert joined.goal == pytest.approx((-1.5, 0.0, 1.2))
    assert joined.displacements.keys() == {"2-4", "3-4"}


def test_heard_is_exactly_what_the_step_used() -> None:
    brain = agent(4)
    hear(brain, T0, hand(7), state(1, 3), state(2, 5), state(3, 6))
    first = brain.step(T0 + 1 * MS, FLYING, 0.0)
    assert first.heard == {HEARD_HAND: Heard(T0, 7, T0), TWO: Heard(T0, 5, T0), THREE: Heard(T0, 6, T0)}
    hear(brain, T0 + 5 * MS, hand(8), hand(9), state(3, 7))
    second = brain.step(T0 + 6 * MS, FLYING, 0.0)
    assert second.heard == {
        HEARD_HAND: Heard(T0, 9, T0 + 5 * MS),
        TWO: Heard(T0, 5, T0),
        THREE: Heard(T0, 7, T0 + 5 * MS),
    }
    assert Flag.EXTRAPOLATING in second.flags


def test_it_steps_once_hand_and_every_live_reference_are_new() -> None:
    brain = agent(4)
    hear(brain, T0, hand(0), state(2, 0), state(3, 0))
    brain.step(T0, FLYING, 0.0)
    fast, slow = T0 + 8_333_333, T0 + 25 * MS
    assert brain.due(T0 + MS).at_ns == slow
    hear(brain, T0 + MS, hand(1))
    hear(brain, T0 + MS, state(2, 1))
    assert brain.due(T0 + MS).at_ns == slow
    hear(brain, T0 + MS, state(1, 9))
    assert brain.due(T0 + MS).at_ns == slow
    hear(brain, T0 + MS, state(3, 1))
    assert brain.due(T0 + MS).at_ns == fast


def test_references_that_catch_up_with_the_hand_do_not_wait_for_the_next_one() -> None:
    brain = agent(4)
    hear(brain, T0, hand(1), state(2, 0), state(3, 0))
    brain.step(T0, FLYING, 0.0)
    now, used = T0 + 3 * MS, {HAND.key(): Heard(T0, 1, T0)}
    hear(brain, now, replace(state(2, 1), heard=used))
    assert brain.due(now).at_ns == T0 + 25 * MS, "drone 3 has not caught up"
    hear(brain, now, replace(state(3, 1), heard=used))
    assert brain.due(now).at_ns == T0 + 8_333_333
    brain.step(T0 + 9 * MS, FLYING, 0.0)
    hear(brain, T0 + 17 * MS, hand(2))
    assert brain.due(T0 + 17 * MS).at_ns == T0 + 34 * MS, "and now it is in step with them again"


def test_it_awaits_its_references_and_then_the_hand() -> None:
    brain, leader = agent(4), agent(1)
    assert brain.due(T0).awaits == leader.due(T0).awaits == [HAND.key()], "nobody has been heard yet"
    hear(brain, T0, hand(0), state(1, 0), state(2, 0), state(3, 0))
    assert brain.due(T0).awaits == []
    brain.step(T0, FLYING, 0.0)
    assert brain.due(T0).awaits == [TWO, THREE]
    hear(brain, T0, state(1, 1), state(3, 1))
    assert brain.due(T0).awaits == [TWO]
    hear(brain, T0, state(2, 1))
    assert brain.due(T0).awaits == [HAND.key()]
    hear(brain, T0, hand(1))
    assert brain.due(T0).awaits == []


def test_it_does_not_wait_for_a_reference_that_is_lost_nor_for_a_silent_hand() -> None:
    brain = agent(4)
    hear(brain, T0, hand(0), state(2, 0), state(3, 0))
    later = T0 + 600 * MS
    brain.step(later, FLYING, 0.0)
    hear(brain, later, state(2, 1))
    assert brain.due(later).at_ns == later + 8_333_333


def test_a_hand_that_is_not_there_moves_nothing() -> None:
    brain = agent(1)
    hear(brain, T0, hand(0, position=NO_HAND, wish=Wish.HOLD))
    held = brain.step(T0, FLYING, 0.0)
    assert (held.mode, held.goal) == (Mode.HOLD, FLYING.position)
    assert HEARD_HAND in held.heard


def test_a_slow_pursuit_does_not_depend_on_the_year() -> None:
    """Stamps in seconds since 1970 would be good to a quarter of a microsecond only."""
    goals = []
    for epoch in (0, T0, T0 + 123_456_789):
        brain = agent(1)
        hear(brain, T0, hand(0, epoch=epoch))
        brain.step(T0, FLYING, 0.0)
        for tick in range(1, 60):
            now = T0 + tick * 16 * MS
            hear(brain, now, hand(tick, position=(1.0, 0.0, 1.2), epoch=epoch))
            hear(brain, now, *(state(other, tick, position=(-3.0, other, 1.2)) for other in (2, 3, 4)))
            latest = brain.step(now, FLYING, 0.0)
        goals.append(latest.goal)
    # 59 samples at 60 Hz and 0.75 m/s, less the displacement of the link.
    assert 0.1 < goals[0][0] + 0.5 < 0.75 * 59 / 60
    assert goals[1] == goals[0]
    assert goals[2] == goals[0]


@given(data=st.data(), airborne=st.booleans())
def test_whatever_valid_messages_say_the_state_is_valid_too(data: Any, airborne: bool) -> None:
    brain = agent(4)
    now = T0
    for _ in range(3):
        sample = data.draw(MESSAGES[HandSample])
        references = [replace(data.draw(MESSAGES[DroneState]), id=drone) for drone in (2, 3)]
        hear(brain, now, sample, *references)
        now += data.draw(st.integers(1, 2 * NS_PER_S))
        published = brain.step(now, FLYING if airborne else GROUNDED, data.draw(st.floats(0.0, 2.0)))
        assert decode(encode(published), DroneState) == published


class FakeVehicle:
    """Notes what it is told; ends the flight after some commands."""

    def __init__(self, poses: list[Pose | None], stopping: threading.Event) -> None:
        self.orders: list[str] = []
        self._poses = poses
        self._stopping = stopping

    def pose(self) -> Pose | None:
        return self._poses.pop(0) if len(self._poses) > 1 else self._poses[0]

    def fly(self, setpoint: Vector) -> None:
        assert len(setpoint) == 3
        self._note("fly")

    def idle(self) -> None:
        self._note("idle")

    def stop(self) -> None:
        self._note("stop")

    def descend(self) -> None:
        self._note("descend")

    def close(self) -> None:
        self._note("close")

    def _note(self, order: str) -> None:
        self.orders.append(order)
        if len(self.orders) >= 5:
            self._stopping.set()


def encounters(brain: Agent, at: int) -> list[Vector]:
    """Returns where a drone believes the others to be."""
    company = brain._look_around(at)
    return [(each.x, each.y, 0.0) for each in brain._inputs(at, FLYING, 0.0, company).drones]


def test_a_liar_moves_nobody_and_its_body_is_not_forgotten_while_it_speaks() -> None:
    brain = agent(1)
    brain.step(T0, FLYING, 0.0)
    hear(brain, T0, state(2, 0, position=(-1.0, 0.5, 1.2)))
    for tick in range(1, 600):
        now = T0 + tick * 16 * MS
        hear(brain, now, state(2, tick, position=(-0.5, 60.0 + tick % 2, 1.2)))
        told = brain.step(now, FLYING, 0.0)
        assert Flag.REJECTED_INPUT in told.flags
        assert encounters(brain, now) == [(-1.0, 0.5, 0.0)]
    assert brain.senses.rejected == {"outside": 599}
    forgotten = HAND_LAND + 1.2 / SCENARIO.limits.landing_speed + SETTLING
    assert len(encounters(brain, now + round((forgotten - 0.1) * NS_PER_S))) == 1
    assert encounters(brain, now + round((forgotten + 0.1) * NS_PER_S)) == []
    assert Flag.REJECTED_INPUT not in brain.step(now + 2 * NS_PER_S, FLYING, 0.0).flags


class Ticker:
    """A clock that advances by one millisecond whenever it is read."""

    def __init__(self) -> None:
        self.now = T0

    def __call__(self) -> int:
        self.now += MS
        return self.now


@pytest.mark.parametrize(
    ("mode", "order"),
    [(Mode.GROUND, "idle"), (Mode.STOP, "stop")]
    + [(mode, "fly") for mode in (Mode.TAKEOFF, Mode.FOLLOW, Mode.HOLD, Mode.LAND)],
)
def test_each_mode_has_its_command(mode: Mode, order: str) -> None:
    vehicle = FakeVehicle([None], threading.Event())
    command(vehicle, state(1, 0, mode))
    assert vehicle.orders == [order]


def test_the_age_of_a_pose_counts_from_when_it_was_first_seen() -> None:
    watch = PoseWatch(FakeVehicle([None, FLYING, FLYING, replace(FLYING, seq=2)], threading.Event()))
    assert watch.read(T0) is None
    seen = [watch.read(T0 + tick * 100 * MS) for tick in range(1, 5)]
    assert [pair[1] for pair in seen if pair] == pytest.approx([0.0, 0.1, 0.0, 0.1])


def test_the_loop_waits_for_a_pose_then_steps_commands_and_publishes() -> None:
    network = MemoryNetwork()
    bus, observer = MemoryBus(network), MemoryBus(network)
    clock, stopping = Ticker(), threading.Event()
    heard = Inbox(clock, depth=100)
    observer.subscribe(DRONE_STATE.key(id=1), heard)
    observer.subscribe(STATUS.wildcard, heard)
    inbox = Inbox(clock)
    inbox.put(HAND.key(), b"garbage")
    inbox.put(HAND.key(), encode(hand(0, wish=Wish.STOP)))
    vehicle = FakeVehicle([None, None, FLYING], stopping)
    status = StatusReporter(bus, "drone", 1, clock)
    mouth = Mouth(bus.publisher(DRONE_STATE, id=1), bus.publisher(PLACES, id=1))
    links = NearLinks(lambda _: MemoryBus(network), inbox, clock, ThreadPoolExecutor(1))
    run(agent(1), vehicle, inbox, mouth, links, status, clock, stopping)
    taken = heard.take()
    states = [decode(arrival.payload, DroneState) for arrival in taken[DRONE_STATE.key(id=1)]]
    assert vehicle.orders == ["stop"] * 5
    assert [state.seq for state in states] == list(range(5))
    assert {state.mode for state in states} == {Mode.STOP}
    assert all(state.step_ns < state.stamp_ns for state in states)
    reports = [decode(a.payload, ProcessStatus) for a in taken[STATUS.key(role="drone", id=1)]]
    assert (reports[0].state, reports[-1].state) == ("starting", "ending")
    assert reports[-1].rejected == {"malformed": 1}
