"""What a single value of a configuration may be: validators of attrs, which say by name what is wrong.

Each raises ValueError; `shared.config` says in which file and at which key.
"""

import re
from collections.abc import Sequence
from typing import Any

from attrs import Attribute

from shared.messages import MAX_DRONE_ID
from shared.order import FASTEST_HZ

MAX_PORT = 65_535
SLOWEST_HAND = 10.0
"""A hand is stale after 0.25 s: at this rate one sample may be lost, Hz."""

_ENDPOINT = re.compile(r"[a-z][a-z-]*/[^\s?#]*?(:(?P<port>[0-9]{1,20}))?([?#].*)?")


def positive(_: Any, attribute: "Attribute[Any]", value: float) -> None:
    """Refuses a value that is not positive."""
    if not value > 0:
        raise ValueError(f"{attribute.name} must be > 0, not {value!r}")


def not_negative(_: Any, attribute: "Attribute[Any]", value: float) -> None:
    """Refuses a negative value."""
    if not value >= 0:
        raise ValueError(f"{attribute.name} must be >= 0, not {value!r}")


def hand_rate(_: Any, attribute: "Attribute[Any]", value: float) -> None:
    """Refuses a rate at which a hand would be stale between two samples, or faster than anybody may be."""
    if not SLOWEST_HAND <= value <= FASTEST_HZ:
        raise ValueError(
            f"{attribute.name} must be {SLOWEST_HAND:g} to {FASTEST_HZ} Hz, not {value!r}:"
            " a slower hand is stale before the next sample comes"
        )


def port(_: Any, attribute: "Attribute[Any]", value: int) -> None:
    """Refuses a number that is no port."""
    if not 0 <= value <= MAX_PORT:
        raise ValueError(f"{attribute.name} must be a port from 0 to {MAX_PORT}, not {value!r}")


def check_endpoint(key: str, endpoint: str) -> None:
    """Looks whether a Zenoh endpoint has a protocol, and no port that is none.

    Raises:
        ValueError: With the key.
    """
    match = _ENDPOINT.fullmatch(endpoint)
    if not match or (match["port"] and int(match["port"]) > MAX_PORT):
        raise ValueError(f"{key} {endpoint!r}: expected PROTOCOL/HOST:PORT, for example tcp/10.0.0.2:7447")


def check_box(low: Sequence[float], high: Sequence[float]) -> None:
    """Refuses a box whose lower corner is above its upper one."""
    if any(a > b for a, b in zip(low, high, strict=True)):
        raise ValueError(f"min {low} must not exceed max {high}")


def key_chunk(_: Any, attribute: "Attribute[Any]", value: str) -> None:
    """Refuses what cannot be one chunk of a key."""
    if not value or not all(c.isalnum() or c in "-_" for c in value):
        raise ValueError(
            f"{attribute.name} must be letters, digits, - or _ (it becomes a key prefix), not {value!r}"
        )


def drone_number(_: Any, attribute: "Attribute[Any]", value: int) -> None:
    """Refuses a number that no drone can have."""
    if not 0 < value <= MAX_DRONE_ID:
        raise ValueError(f"{attribute.name} must be 1 to {MAX_DRONE_ID}, not {value!r}")
