"""The topic table: keys, wildcards, and that the other tables agree with it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.modes import HAND_STALE
from agents.control.single.repair import REFERENCE_LOST
from shared.config import load_scenario
from shared.errors import DecodeError
from shared.scenario import Rates
from shared.topics import (
    ALIVE,
    DRONE_STATE,
    FORMATION_STATE,
    HAND,
    PATTERN,
    STATUS,
    TOPICS,
    Delivery,
    Topic,
    topic_of,
)

KEYS = [
    (HAND, HAND.key(), "human/hand"),
    (DRONE_STATE, DRONE_STATE.key(id=2), "drone/2/state"),
    (FORMATION_STATE, FORMATION_STATE.key(), "formation/state"),
    (PATTERN, PATTERN.key(), "glove/pattern"),
    (STATUS, STATUS.key(role="drone", id=2), "status/drone/2"),
]


@pytest.mark.parametrize(("topic", "key", "text"), KEYS)
def test_keys_are_those_of_the_design(topic: Topic, key: str, text: str) -> None:
    assert key == text
    assert topic_of(key) is topic


def test_wildcards_have_one_star_per_varying_chunk() -> None:
    assert {topic.wildcard for topic in TOPICS} == {
        "human/hand",
        "drone/*/state",
        "formation/state",
        "glove/pattern",
        "status/*/*",
    }


@given(number=st.integers(1, 65_535))
def test_each_key_belongs_to_one_topic_only(number: int) -> None:
    for topic in TOPICS:
        key = topic.key(role="drone", id=number)
        assert [other for other in TOPICS if _matches(other.wildcard, key)] == [topic]


@given(key=st.text(alphabet="drone/1stahumk{}*", max_size=20))
def test_a_key_has_its_topic_or_is_refused(key: str) -> None:
    owners = [topic for topic in TOPICS if _matches(topic.wildcard, key)]
    if owners:
        assert [topic_of(key)] == owners
    else:
        with pytest.raises(DecodeError) as refused:
            topic_of(key)
        assert refused.value.reason == "unknown-key"


@pytest.mark.parametrize("key", ["", "human", "human/hand/2", "human/foot", "drone/2", "alive/drone/2"])
def test_other_keys_are_refused_by_name(key: str) -> None:
    with pytest.raises(DecodeError, match="unknown-key"):
        topic_of(key)


def test_presence_does_not_mix_with_messages() -> None:
    key = ALIVE.format(role="drone", id=2)
    assert key == "alive/drone/2"
    assert not any(_matches(topic.wildcard, key) for topic in TOPICS)


def test_what_drives_control_is_state_and_what_informs_is_reliable() -> None:
    by_delivery = {delivery: {t for t in TOPICS if t.delivery is delivery} for delivery in Delivery}
    assert by_delivery == {
        Delivery.STATE: {HAND, DRONE_STATE, FORMATION_STATE},
        Delivery.EVENT: {PATTERN, STATUS},
    }


def test_the_failsafe_times_are_those_of_the_table() -> None:
    assert HAND.stale_s == HAND_STALE
    assert DRONE_STATE.stale_s == REFERENCE_LOST
    assert HAND.rate_hz == Rates().hand_hz == load_scenario("rhombus").rates.hand_hz


def _matches(expression: str, key: str) -> bool:
    pattern, chunks = expression.split("/"), key.split("/")
    return len(pattern) == len(chunks) and all(p in ("*", c) for p, c in zip(pattern, chunks, strict=True))
