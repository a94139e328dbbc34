import itertools
import math
import os
from collections.abc import Iterator

import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

from human_relay.guard import WALK
from human_relay.orders import OrderReader
from human_relay.relay import (
    PATIENCE_NS,
    PERIOD_NS,
    RelayState,
    due_ns,
    has_news,
    make_sample,
    order,
    repeat_ns,
)
from human_relay.sources.base import HandPose
from shared.clock import NS_PER_S
from shared.codec import decode, encode
from shared.messages import NO_HAND, ORIGIN, HandSample, Wish

START = 1_000 * NS_PER_S


def pose(tick: int, x: float = 0.0, mode: Wish = Wish.FLY, yaw: float = 0.0) -> HandPose:
    return HandPose(position=(x, 0.0, 1.2), yaw=yaw, mode=mode, t_ns=START + tick * PERIOD_NS)


def relay_moving_hand(ticks: int, speed: float = 0.3) -> tuple[RelayState, HandSample]:
    """Relays a hand that moves along x, sample by sample."""
    state = RelayState(epoch=START)
    for tick in range(ticks):
        offered = pose(tick, x=speed * tick / 60)
        state, sample = make_sample(state, offered, offered.t_ns)
    return state, sample


def test_the_envelope_counts_from_zero_within_one_epoch() -> None:
    state = RelayState(epoch=START)
    samples = []
    for tick in range(3):
        state, sample = make_sample(state, pose(tick), START + tick * PERIOD_NS)
        samples.append(sample)
    assert [sample.seq for sample in samples] == [0, 1, 2]
    assert {sample.epoch for sample in samples} == {START}
    assert [sample.stamp_ns for sample in samples] == [START + tick * PERIOD_NS for tick in range(3)]


def test_a_moving_hand_is_relayed_with_its_velocity() -> None:
    _, sample = relay_moving_hand(12)
    assert sample.position == pytest.approx((0.3 * 11 / 60, 0.0, 1.2))
    assert sample.velocity == pytest.approx((0.3, 0.0, 0.0), abs=1e-4)
    assert sample.mode is Wish.FLY


def test_a_relay_without_a_pose_holds() -> None:
    state, sample = make_sample(RelayState(epoch=START), None, START)
    assert (sample.mode, sample.position, sample.velocity) == (Wish.HOLD, NO_HAND, ORIGIN)
    _, armed = make_sample(state, pose(1), START + PERIOD_NS)
    assert armed.mode is Wish.FLY


def test_a_released_hand_holds_at_its_last_position_at_rest() -> None:
    state, before = relay_moving_hand(12)
    state, released = make_sample(state, None, START + 12 * PERIOD_NS)
    assert released.mode is Wish.HOLD
    assert released.position == before.position
    assert released.velocity == ORIGIN
    _, back = make_sample(state, pose(13, x=0.3 * 13 / 60), START + 13 * PERIOD_NS)
    assert back.mode is Wish.FLY
    assert back.velocity == ORIGIN


WILD = {
    "nan": evolve(pose(12), position=(math.nan, 0.0, 1.2)),
    "infinite": evolve(pose(12), position=(0.0, math.inf, 1.2)),
    "far": evolve(pose(12), position=(0.0, 0.0, 1_000.1)),
    "fast": evolve(pose(12), position=(1.0, 0.0, 1.2)),
    "yaw": evolve(pose(12), yaw=math.nan),
}


@pytest.mark.parametrize("wild", WILD.values(), ids=WILD.keys())
def test_an_impossible_pose_is_replaced_and_counted(wild: HandPose) -> None:
    state, before = relay_moving_hand(12)
    state, sample = make_sample(state, wild, wild.t_ns)
    assert (sample.mode, sample.position, sample.velocity) == (Wish.HOLD, before.position, ORIGIN)
    assert state.rejected == 1
    state, good = make_sample(state, pose(13, x=0.3 * 13 / 60), START + 13 * PERIOD_NS)
    assert good.mode is Wish.FLY
    assert state.rejected == 1


anything = st.floats(allow_nan=True, allow_infinity=True)
poses = st.none() | st.builds(
    HandPose,
    position=st.tuples(anything, anything, anything),
    yaw=anything,
    mode=st.sampled_from(Wish),
    t_ns=st.integers(START, START + NS_PER_S),
)


@given(st.lists(st.tuples(poses, st.booleans()), max_size=30))
def test_whatever_the_source_offers_receivers_accept_the_sample(
    offers: list[tuple[HandPose | None, bool]],
) -> None:
    state = RelayState(epoch=START)
    for tick, (offered, finished) in enumerate(offers):
        state, sample = make_sample(state, offered, START + tick * PERIOD_NS, finished=finished)
        assert decode(encode(sample), HandSample) == sample


def test_a_stalled_source_keeps_its_position_and_loses_its_velocity() -> None:
    state, before = relay_moving_hand(12)
    last = state.pose
    assert last is not None
    state, soon = make_sample(state, last, last.t_ns + 99_000_000)
    _, later = make_sample(state, last, last.t_ns + 101_000_000)
    assert soon.velocity == before.velocity
    assert later.velocity == ORIGIN
    assert later.position == before.position
    assert later.mode is Wish.FLY


def test_only_a_later_stamp_is_news() -> None:
    state, _ = relay_moving_hand(3)
    assert not has_news(state, state.pose)
    assert not has_news(state, None)
    assert has_news(state, pose(3))
    assert has_news(RelayState(epoch=START), pose(0))


def test_one_lost_frame_is_not_repeated_but_a_silence_is_at_60_hz() -> None:
    state, _ = relay_moving_hand(3)
    sent = START + 2 * PERIOD_NS
    assert repeat_ns(state) == sent + PATIENCE_NS > sent + 2 * PERIOD_NS
    state, _ = make_sample(state, state.pose, sent + PATIENCE_NS)
    assert repeat_ns(state) == sent + PATIENCE_NS + PERIOD_NS


def mode_after(*orders: Wish, source: Wish = Wish.FLY, finished: bool = False) -> Wish:
    state = RelayState(epoch=START)
    for wish in orders:
        state = order(state, wish)
    return make_sample(state, pose(0, mode=source), START, finished=finished)[1].mode


@pytest.mark.parametrize(
    ("orders", "expected"),
    [
        ((), Wish.FLY),
        ((Wish.HOLD,), Wish.HOLD),
        ((Wish.HOLD, Wish.FLY), Wish.FLY),
        ((Wish.LAND,), Wish.LAND),
        ((Wish.LAND, Wish.HOLD), Wish.LAND),
        ((Wish.LAND, Wish.FLY), Wish.FLY),
        ((Wish.STOP, Wish.FLY), Wish.STOP),
        ((Wish.STOP, Wish.LAND), Wish.STOP),
    ],
)
def test_orders_latch_by_strength(orders: tuple[Wish, ...], expected: Wish) -> None:
    assert mode_after(*orders) is expected


@pytest.mark.parametrize("source", Wish)
def test_the_source_speaks_where_nothing_is_ordered(source: Wish) -> None:
    assert mode_after(source=source) is source


def test_the_strongest_wish_wins() -> None:
    assert mode_after(Wish.HOLD, source=Wish.LAND) is Wish.LAND
    assert mode_after(Wish.LAND, source=Wish.HOLD) is Wish.LAND
    assert mode_after(Wish.STOP, source=Wish.LAND) is Wish.STOP


def test_a_finished_source_lands_for_ever() -> None:
    assert mode_after(finished=True) is Wish.LAND
    assert mode_after(Wish.FLY, finished=True) is Wish.LAND
    assert mode_after(Wish.STOP, finished=True) is Wish.STOP


def test_a_stop_of_the_source_is_final() -> None:
    state, first = make_sample(RelayState(epoch=START), pose(0, mode=Wish.STOP), START)
    state = order(state, Wish.FLY)
    _, second = make_sample(state, pose(1), START + PERIOD_NS)
    assert (first.mode, second.mode) == (Wish.STOP, Wish.STOP)


@pytest.fixture
def pipe() -> Iterator[tuple[OrderReader, int]]:
    reading, writing = os.pipe()
    with os.fdopen(reading), os.fdopen(writing, "wb", closefd=False):
        yield OrderReader(reading), writing
        try:
            os.close(writing)
        except OSError:
            assert True  # a test closed it: the end of the input


def test_orders_are_whole_lines(pipe: tuple[OrderReader, int]) -> None:
    reader, writing = pipe
    os.write(writing, b" Land \nho")
    assert reader.wait(1.0) == [Wish.LAND]
    os.write(writing, b"ld\nfly\n")
    assert reader.wait(1.0) == [Wish.HOLD, Wish.FLY]


def test_nonsense_is_no_order(pipe: tuple[OrderReader, int], caplog: pytest.LogCaptureFixture) -> None:
    reader, writing = pipe
    os.write(writing, b"\xff\xfe\n\nfly away\nstop\n")
    assert reader.wait(1.0) == [Wish.STOP]
    assert "orders: fly, hold, land, stop" in caplog.text


def test_the_end_of_the_input_is_no_order(pipe: tuple[OrderReader, int]) -> None:
    reader, writing = pipe
    os.close(writing)
    assert reader.wait(1.0) == []
    assert reader.wait(0.0) == []


def test_a_relay_without_standard_input_gets_no_orders() -> None:
    assert OrderReader(None).wait(0.0) == []


def test_a_hand_that_jumps_holds_where_it_was_and_then_walks_there() -> None:
    state, before = relay_moving_hand(30)
    said = []
    for tick in range(30, 180):
        state, sample = make_sample(state, pose(tick, x=1.5), START + tick * PERIOD_NS)
        said.append(sample)
    held = [sample for sample in said if sample.jumped]
    assert {sample.mode for sample in held} == {Wish.HOLD}
    assert (held[0].position, held[0].velocity) == (before.position, ORIGIN)
    steps = [math.dist(a.position, b.position) * 60.0 for a, b in itertools.pairwise([before, *said])]
    assert max(steps) <= WALK + 1e-6
    assert max(math.hypot(*sample.velocity) for sample in said) <= WALK + 1e-3
    assert (said[-1].position[0], said[-1].mode, said[-1].jumped) == (1.5, Wish.FLY, False)
    assert state.guard.jumps == 1


@pytest.mark.parametrize("wish", [Wish.LAND, Wish.STOP])
def test_the_operator_is_heard_even_if_the_hand_has_jumped(wish: Wish) -> None:
    state, before = relay_moving_hand(12)
    wild = evolve(pose(12, x=2.0), mode=wish)
    assert due_ns(state, wild) == 0
    state, sample = make_sample(state, wild, wild.t_ns)
    assert (sample.mode, sample.position, sample.jumped) == (wish, before.position, True)
    assert due_ns(state, wild) > wild.t_ns
