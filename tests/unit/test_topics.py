"""The topic table: keys, wildcards, and that the other tables agree with it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.control.modes import HAND_STALE
from agents.control.repair import REFERENCE_LOST
from shared.config import load_scenario
from shared.errors import DecodeError
from shared.scenario import Rates
from shared.topics import (
    ALIVE,
    DRONE_STATE,
    FORMATION_STATE,
    HAND,
    OBSTACLE,
    PATTERN,
    PLACES,
    STATUS,
    TOPICS,
    Delivery,
    Topic,
    parse_key,
    parse_presence,
    topic_of,
)

KEYS = [
    (HAND, HAND.key(), "human/hand"),
    (DRONE_STATE, DRONE_STATE.key(id=2), "drone/2/state"),
    (PLACES, PLACES.key(id=2), "drone/2/places"),
    (FORMATION_STATE, FORMATION_STATE.key(), "formation/state"),
    (PATTERN, PATTERN.key(), "glove/pattern"),
    (STATUS, STATUS.key(role="drone", id=2), "status/drone/2"),
]


FOREIGN = (
    *("", "human", "human/hand/2", "human/foot", "drone/2", "alive/drone/2", "**", "human/*", "drone/*/state"),
    *("drone/x/state", "drone/02/state", "drone/-1/state", "drone/65536/state", f"drone/{'9' * 5000}/state"),
    *("drone/2/state\n", "drone/²/state", "status/[red]/0", "status/Drone/1", "status/drone/1/2"),
    *("status/drone/", f"status/{'a' * 17}/0", "status/\x1b[31m/0", "replay/human/hand", "\udce9"),
)


@pytest.mark.parametrize(("topic", "key", "text"), KEYS)
def test_keys_are_those_of_the_design(topic: Topic, key: str, text: str) -> None:
    assert key == text
    assert topic_of(key) is topic


def test_wildcards_have_one_star_per_varying_chunk() -> None:
    assert {topic.wildcard for topic in TOPICS} == {
        "human/hand",
        "drone/*/state",
        "drone/*/places",
        "obstacle/*",
        "formation/state",
        "glove/pattern",
        "status/*/*",
    }


@given(number=st.integers(1, 65_535))
def test_each_key_belongs_to_one_topic_only(number: int) -> None:
    for topic in TOPICS:
        key = topic.key(role="drone", id=number)
        assert [other for other in TOPICS if _matches(other.wildcard, key)] == [topic]


@given(key=st.text(alphabet="drone/1stahumk{}*", max_size=20) | st.text())
def test_a_key_says_who_speaks_on_what_or_is_refused(key: str) -> None:
    try:
        place = parse_key(key)
    except DecodeError:
        return
    assert place.topic.key(role=place.role, id=place.id) == key
    assert [topic for topic in TOPICS if _matches(topic.wildcard, key)] == [place.topic]


@given(role=st.sampled_from(["drone", "relay", "observer"]), number=st.integers(0, 65_535))
def test_every_process_has_a_token_and_a_status(role: str, number: int) -> None:
    assert parse_presence(ALIVE.format(role=role, id=number)) == f"{role}/{number}"
    assert parse_key(STATUS.key(role=role, id=number)) == (STATUS, role, number)


@pytest.mark.parametrize(
    "token",
    [
        *(key for key in FOREIGN if key != "alive/drone/2"),
        "alive/drone",
        "alive/**",
        "alive/drone/01",
        f"alive/drone/{'9' * 5000}",
        "alive/[b]/1",
    ],
)
def test_foreign_tokens_are_nobodys(token: str) -> None:
    with pytest.raises(DecodeError, match="unknown-key"):
        parse_presence(token)


@pytest.mark.parametrize("key", FOREIGN)
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
        Delivery.STATE: {HAND, DRONE_STATE, PLACES, OBSTACLE, FORMATION_STATE},
        Delivery.EVENT: {PATTERN, STATUS},
    }


def test_the_failsafe_times_are_those_of_the_table() -> None:
    assert HAND.stale_s == HAND_STALE
    assert DRONE_STATE.stale_s == REFERENCE_LOST
    assert HAND.rate_hz == Rates().hand_hz == load_scenario("rhombus").rates.hand_hz


def _matches(expression: str, key: str) -> bool:
    pattern, chunks = expression.split("/"), key.split("/")
    return len(pattern) == len(chunks) and all(p in ("*", c) for p, c in zip(pattern, chunks, strict=True))
