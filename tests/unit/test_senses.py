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
from shared.formation import build_formation
from shared.messages import ORIGIN, DroneState, HandSample, Heard, Message, Mode, Wish
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
SILENCE_NS = round(HAND.stale_s * NS_PER_S)


def senses() -> Senses:
    return Senses(neighbours(SCENARIO, FORMATION, 4))


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


@pytest.mark.parametrize("seq", [10, 9, 0])
def test_a_repeated_or_older_sample_is_out_of_order_however_late(seq: int) -> None:
    sensing = senses()
    hear(sensing, HAND.key(), SAMPLE)
    hear(sensing, HAND.key(), replace(SAMPLE, seq=seq), at=100 * SILENCE_NS)
    assert sensing.rejected == {"out-of-order": 1}
    assert sensing.hand is not None
    assert sensing.hand.arrival_ns == 0


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
