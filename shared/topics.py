"""The one table of topics: rates, staleness and delivery all derive from these rows (DESIGN section 3).

Keys live under the swarm's name (the Zenoh `namespace`), so several swarms share a network.
"""

import enum
import functools
import re
from typing import Any, NamedTuple

from attrs import frozen

from shared.errors import DecodeError
from shared.messages import (
    MAX_DRONE_ID,
    DroneState,
    FormationState,
    HandSample,
    Message,
    ObstacleState,
    PatternEvent,
    Places,
    ProcessStatus,
)


class Delivery(enum.StrEnum):
    """How hard the network tries."""

    STATE = "state"
    """Best effort, dropped under congestion, express, real-time priority: only the newest counts."""
    EVENT = "event"
    """Reliable, in order."""


@frozen
class Topic:
    """One row: a key pattern and everything that is true of it.

    Attributes:
        pattern: Key with `{...}` where it varies.
        kind: Message type.
        rate_hz: Nominal rate, 0 for events.
        stale_s: Age after which its content is no longer current, s.
        delivery: Quality of service.
    """

    pattern: str
    kind: type[Message]
    rate_hz: float
    stale_s: float
    delivery: Delivery

    @property
    def wildcard(self) -> str:
        """Key expression that matches every key of this topic."""
        return "/".join("*" if chunk.startswith("{") else chunk for chunk in self.pattern.split("/"))

    def key(self, **parts: object) -> str:
        """Returns the concrete key, for example `DRONE_STATE.key(id=2)`."""
        return self.pattern.format(**parts)


HAND = Topic("human/hand", HandSample, 60.0, 0.25, Delivery.STATE)
DRONE_STATE = Topic("drone/{id}/state", DroneState, 60.0, 0.5, Delivery.STATE)
PLACES = Topic("drone/{id}/places", Places, 5.0, 1.0, Delivery.STATE)
OBSTACLE = Topic("obstacle/{id}", ObstacleState, 30.0, 0.25, Delivery.STATE)
FORMATION_STATE = Topic("formation/state", FormationState, 20.0, 0.5, Delivery.STATE)
PATTERN = Topic("glove/pattern", PatternEvent, 0.0, 0.0, Delivery.EVENT)
STATUS = Topic("status/{role}/{id}", ProcessStatus, 1.0, 3.0, Delivery.EVENT)

TOPICS = (HAND, DRONE_STATE, PLACES, OBSTACLE, FORMATION_STATE, PATTERN, STATUS)

ALIVE = "alive/{role}/{id}"
"""Key of a process's liveliness token."""


_DIGITS = 9
"""Longer numbers are none of ours; anybody may send them."""


def matches(expression: str, key: str) -> bool:
    """Says whether a key expression (`*` is one chunk) covers a key."""
    pattern, chunks = expression.split("/"), key.split("/")
    return len(pattern) == len(chunks) and all(p in ("*", c) for p, c in zip(pattern, chunks, strict=True))


def rank(key: str) -> tuple[int, tuple[tuple[int, str], ...]]:
    """Sorts keys for people: in the order of the table, numbers as numbers, what is in no row last."""
    row = next((n for n, topic in enumerate(TOPICS) if matches(topic.wildcard, key)), len(TOPICS))
    return row, tuple(
        (int(chunk), "") if chunk.isdecimal() and len(chunk) <= _DIGITS else (0, chunk)
        for chunk in key.split("/")
    )


class Place(NamedTuple):
    """What a key says: its topic, and who speaks on it; empty and 0 where the key does not say."""

    topic: Topic
    role: str = ""
    id: int = 0


@functools.lru_cache(maxsize=4096)
def parse_key(key: str) -> Place:
    """Finds the row that a concrete key belongs to, and who speaks on it; keys come from anyone.

    Raises:
        DecodeError: No topic has such a key; nothing else is ever raised.
    """
    for topic, pattern in _PATTERNS:
        if found := pattern.fullmatch(key):
            return Place(topic, **_speaker(found))
    raise DecodeError("unknown-key", f"{key!r:.80}")


def topic_of(key: str) -> Topic:
    """Returns the row that a concrete key belongs to; errors as for `parse_key`."""
    return parse_key(key).topic


def parse_presence(key: str) -> str:
    """Returns whose liveliness token has this key, as `role/id`.

    Raises:
        DecodeError: It is nobody's.
    """
    found = _PRESENCE.fullmatch(key)
    if found is None:
        raise DecodeError("unknown-key", f"{key!r:.80}")
    _speaker(found)
    return f"{found['role']}/{found['id']}"


def _speaker(found: re.Match[str]) -> dict[str, Any]:
    said: dict[str, Any] = found.groupdict()
    if "id" in said:
        said["id"] = int(said["id"])
        if said["id"] > MAX_DRONE_ID:
            raise DecodeError("unknown-key", f"{found[0]!r:.80}: numbers end at {MAX_DRONE_ID}")
    return said


def _pattern(text: str) -> re.Pattern[str]:
    """Makes an expression of a key; a role is a short word, a number has one way to be written."""
    return re.compile(text.format(role="(?P<role>[a-z]{1,16})", id="(?P<id>0|[1-9][0-9]{0,4})"))


_PATTERNS = [(topic, _pattern(topic.pattern)) for topic in TOPICS]
_PRESENCE = _pattern(ALIVE)
