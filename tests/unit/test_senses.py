"""What an agent accepts, in which order, and how it counts the rest."""

import logging
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from shared.clock import NS_PER_S
from shared.codec import encode
from shared.config import load_scenario
from shared.fence import bodies_of
from shared.formation import build_formation
from shared.messages import NO_HAND, ORIGIN, DroneState, HandSample, Heard, Message, Mode, Vector, Wish
from shared.nodes import neighbours
from shared.senses import Senses
from shared.topics import DRONE_STATE, HAND
from shared.transport import Arrival
from tests.strategies import garbage

SCENARIO = load_scenario("rhombus")
FORMATION = build_formation(SCENARIO)
SAMPLE = HandSample(epoch=5, seq=10, stamp_ns=1, position=ORIGIN, velocity=ORIGIN, yaw=0.0, mode=Wish.FLY)
STATE = DroneState(
    epoch=5,
    seq=10,
    stamp_ns=1,
    id=2,
    position=ORIGIN,
    velocity=ORIGIN,
    goal=ORIGIN,
    goal_velocity=ORIGIN,
    setpoint=ORIGIN,
    mode=Mode.FOLLOW,
)
TWO = DRONE_STATE.key(id=2)
MS = NS_PER_S // 1000
SILENCE_NS = round(HAND.stale_s * NS_PER_S)


def senses() -> Senses:
    return Senses(neighbours(SCENARIO, FORMATION, 4))


def doubting() -> Senses:
    return Senses(neighbours(SCENARIO, FORMATION, 4), None, bodies_of(SCENARIO, FORMATION))


def hear(sensing: Senses, key: str, *messages: Message, at: int = 0) -> None:
    sensing.take({key: [Arrival(encode(message), at) for message in messages]})


def kept(sensing: Senses) -> tuple[int, int]:
    assert sensing.hand is not None
    return (sensing.hand.message.epoch, sensing.hand.message.seq)


def test_it_listens_to_the_hand_and_to_everybody_else() -> None:
    assert senses().keys == ["human/hand", "drone/1/state", "drone/2/state", "drone/3/state"]


def test_the_newest_of_several_is_kept_with_its_arrival() -> None:
    sensing = senses()
    sensing.take(
        {
            HAND.key(): [Arrival(encode(replace(SAMPLE, seq=seq)), 100 + seq) for seq in (10, 11, 12)],
            TWO: [Arrival(encode(STATE), 50)],
        }
    )
    assert sensing.hand is not None
    assert sensing.hand.heard == Heard(5, 12, 112)
    assert sensing.hand.age(112 + NS_PER_S // 2) == pytest.approx(0.5)
    assert sensing.drones[2].message == STATE
    assert sensing.drones.keys() == {2}
    assert not sensing.rejected


@given(order=st.permutations(range(6)))
def test_whatever_the_order_the_newest_wins_and_every_older_one_is_counted(order: list[int]) -> None:
    sensing = senses()
    for seq in order:
        hear(sensing, HAND.key(), replace(SAMPLE, seq=seq))
    newest, late = -1, 0
    for seq in order:
        late += seq < newest
        newest = max(newest, seq)
    assert kept(sensing) == (5, 5)
    assert sensing.rejected == ({"out-of-order": late} if late else {})


@pytest.mark.parametrize("late_ns", [0, SILENCE_NS, 100 * SILENCE_NS])
def test_a_repeated_sample_is_out_of_order_however_late(late_ns: int) -> None:
    sensing = senses()
    hear(sensing, HAND.key(), SAMPLE)
    hear(sensing, HAND.key(), SAMPLE, at=late_ns)
    assert sensing.rejected == {"out-of-order": 1}
    assert sensing.hand is not None
    assert sensing.hand.arrival_ns == 0


@pytest.mark.parametrize("seq", [2**64 - 1, 2**32, 10 + 1_000])
def test_one_sample_out_of_the_future_silences_nobody(seq: int) -> None:
    sensing = senses()
    hear(sensing, HAND.key(), SAMPLE)
    hear(sensing, HAND.key(), replace(SAMPLE, seq=seq), at=MS)
    hear(sensing, HAND.key(), replace(SAMPLE, seq=11, mode=Wish.STOP), at=16 * MS)
    assert kept(sensing) == (5, 11)
    assert sensing.rejected == {"ahead": 1}


@pytest.mark.parametrize("first", [2**64 - 1, 100])
def test_who_was_silenced_by_a_first_sample_out_of_the_future_is_heard_once_that_is_stale(first: int) -> None:
    sensing = senses()
    hear(sensing, TWO, replace(STATE, seq=first))
    stale_ns = round(DRONE_STATE.stale_s * NS_PER_S)
    hear(sensing, TWO, STATE, at=stale_ns)
    assert sensing.rejected == {"out-of-order": 1}
    hear(sensing, TWO, replace(STATE, seq=11), at=stale_ns + 1)
    assert sensing.drones[2].message.seq == 11


@given(gaps_ms=st.lists(st.integers(0, 20_000), min_size=1, max_size=20), rate_hz=st.integers(1, 1000))
def test_whatever_is_lost_or_held_up_the_publisher_is_heard(gaps_ms: list[int], rate_hz: int) -> None:
    sensing, now_ms = senses(), 0
    hear(sensing, TWO, replace(STATE, seq=0))
    for gap_ms in gaps_ms:
        now_ms += gap_ms
        hear(sensing, TWO, replace(STATE, seq=now_ms * rate_hz // 1000 + 1), at=now_ms * MS)
    assert not {"ahead"} & set(sensing.rejected)


def test_a_restarted_publisher_is_heard_from_its_first_sample() -> None:
    sensing = senses()
    hear(sensing, HAND.key(), SAMPLE, replace(SAMPLE, epoch=6, seq=0))
    assert kept(sensing) == (6, 0)
    assert not sensing.rejected


def test_an_older_epoch_is_heard_only_after_the_newer_one_has_fallen_silent() -> None:
    """Or a publisher whose clock was set back would never be heard again."""
    sensing = senses()
    older = replace(SAMPLE, epoch=4, seq=99)
    hear(sensing, HAND.key(), SAMPLE)
    hear(sensing, HAND.key(), older, at=SILENCE_NS)
    assert kept(sensing) == (5, 10)
    assert sensing.rejected == {"out-of-order": 1}
    hear(sensing, HAND.key(), older, at=SILENCE_NS + 1)
    assert kept(sensing) == (4, 99)
    hear(sensing, HAND.key(), replace(older, seq=98), at=SILENCE_NS + 2)
    assert kept(sensing) == (4, 99)


def test_a_drone_is_only_heard_on_its_own_key() -> None:
    sensing = senses()
    hear(sensing, TWO, replace(STATE, id=3))
    hear(sensing, DRONE_STATE.key(id=3), STATE)
    assert not sensing.drones
    assert sensing.rejected == {"wrong-id": 2}


@pytest.mark.parametrize("key", [DRONE_STATE.key(id=4), DRONE_STATE.key(id=9), "human/foot", ""])
def test_other_keys_are_unknown(key: str) -> None:
    """Its own state, too: nobody else speaks for this drone."""
    sensing = senses()
    hear(sensing, key, replace(STATE, id=4))
    assert sensing.rejected == {"unknown-key": 1}


def test_each_reason_is_counted() -> None:
    sensing = senses()
    payload = encode(SAMPLE)
    bad = [b"", payload[:-1], bytes(5_000), payload.replace(b"\xa3FLY", b"\xa3FLI")]
    sensing.take({HAND.key(): [Arrival(p, 0) for p in (*bad, payload)]})
    assert sensing.rejected == {"malformed": 2, "oversized": 1, "out-of-range": 1}
    assert kept(sensing) == (5, 10)


@given(data=st.data(), kind=st.sampled_from([HandSample, DroneState]))
def test_garbage_is_counted_and_changes_nothing(data: Any, kind: type[Message]) -> None:
    sensing = senses()
    hear(sensing, HAND.key(), SAMPLE)
    hear(sensing, TWO, STATE)
    payload = data.draw(garbage(kind))
    sensing.take({HAND.key() if kind is HandSample else TWO: [Arrival(payload, 1)]})
    assert sum(sensing.rejected.values()) == 1
    assert kept(sensing) == (5, 10)
    assert sensing.drones[2].message == STATE


def test_the_log_is_limited_in_rate(caplog: pytest.LogCaptureFixture) -> None:
    sensing = senses()
    with caplog.at_level(logging.WARNING, logger="senses"):
        for tenth in range(121):
            sensing.take({HAND.key(): [Arrival(b"garbage", 10 * NS_PER_S + tenth * NS_PER_S // 10)]})
    assert sensing.rejected == {"malformed": 121}
    assert len(caplog.records) == 3
    assert all("human/hand" in record.getMessage() for record in caplog.records)
    assert "'malformed': 103" in caplog.records[-1].getMessage()


AT_HOME = replace(STATE, position=(0.0, 0.0, 1.2), goal=(0.0, 0.0, 1.2))
IMPOSSIBLE = {
    "jump": {"position": (1.0, 1.0, 1.2)},
    "too-fast": {"velocity": (30.0, 0.0, 0.0)},
    "outside": {"position": (0.0, 60.0, 1.2)},
    "unreachable": {"ahead": (0.3, 0.0, 1.2)},
    "unreachable-aside": {"velocity": (0.0, 2.0, 0.0), "ahead": (0.3, 0.2, 1.2)},
    "unreachable-above": {"velocity": (0.0, 2.0, 0.0), "ahead": (0.0, 0.2, 1.6)},
    "unreachable-late": {"velocity": (2.0, 0.0, 0.0), "ahead": (1.5, 0.0, 1.2)},
    "too-hard": {"asked": (-45.0, 0.0, 0.0)},
    "too-hard-soon": {"pace": (-4.0, 0.0, 0.0)},
}


@pytest.mark.parametrize("lie", IMPOSSIBLE)
def test_a_drone_that_lies_about_its_place_is_neither_avoided_nor_followed_there(lie: str) -> None:
    sensing = doubting()
    hear(sensing, TWO, AT_HOME)
    hear(sensing, TWO, replace(AT_HOME, seq=11, **IMPOSSIBLE[lie]), at=16 * MS)
    assert sensing.drones[2].message == AT_HOME
    (reason,) = sensing.rejected
    assert lie.startswith(reason)
    assert sensing.doubted_ns == {TWO: 16 * MS}


@pytest.mark.parametrize(
    "lie", [{"goal": (0.0, 60.0, 1.2)}, {"goal_velocity": (0.0, 30.0, 0.0)}], ids=lambda lie: next(iter(lie))
)
def test_a_goal_that_nobody_can_have_is_not_followed(lie: dict[str, Vector]) -> None:
    sensing = doubting()
    hear(sensing, TWO, AT_HOME)
    hear(sensing, TWO, replace(AT_HOME, seq=11, **lie), at=16 * MS)
    assert sensing.drones[2].message == AT_HOME


def test_a_body_that_is_elsewhere_after_a_restart_is_believed_once_it_can_have_got_there() -> None:
    sensing = doubting()
    hear(sensing, TWO, AT_HOME)
    elsewhere = replace(AT_HOME, epoch=6, position=(2.0, 2.0, 0.0))
    for tick in range(60):
        hear(sensing, TWO, replace(elsewhere, seq=tick), at=tick * 16 * MS)
    assert sensing.drones[2].message == replace(elsewhere, seq=59)
    assert sensing.rejected["jump"] < 60 * 0.6


def test_who_only_shows_what_is_said_shows_lies_as_well() -> None:
    sensing = senses()
    hear(sensing, TWO, AT_HOME, replace(AT_HOME, seq=11, position=(0.0, 60.0, 1.2)))
    assert sensing.drones[2].message.position == (0.0, 60.0, 1.2)


JUMPED = replace(SAMPLE, seq=11, position=(2.0, 0.0, 1.0), velocity=(1.0, 0.0, 0.0), yaw=3.0)


@pytest.mark.parametrize(
    ("wish", "kept_wish"),
    [(Wish.FLY, Wish.HOLD), (Wish.HOLD, Wish.HOLD), (Wish.LAND, Wish.LAND), (Wish.STOP, Wish.STOP)],
)
def test_of_a_hand_that_jumps_the_wish_counts_and_the_motion_does_not(wish: Wish, kept_wish: Wish) -> None:
    sensing = senses()
    hear(sensing, HAND.key(), SAMPLE)
    hear(sensing, HAND.key(), replace(JUMPED, mode=wish), at=16 * MS)
    assert sensing.hand is not None
    assert sensing.hand.message == replace(SAMPLE, seq=11, mode=kept_wish, jumped=True)
    assert sensing.rejected == {"hand-jump": 1}
    hear(sensing, HAND.key(), replace(JUMPED, seq=12), at=200 * MS)
    assert sensing.hand.message == replace(JUMPED, seq=12)


def test_a_hand_is_judged_anew_where_there_was_none() -> None:
    sensing = senses()
    hear(sensing, HAND.key(), replace(SAMPLE, position=NO_HAND, mode=Wish.HOLD), replace(JUMPED, seq=12))
    assert sensing.hand is not None
    assert sensing.hand.message == replace(JUMPED, seq=12)
    assert not sensing.rejected
