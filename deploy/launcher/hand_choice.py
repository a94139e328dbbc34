"""How the relay of a flight gets its hand: from the source that the user names, from a pointer, or both."""

import os
from contextlib import closing
from pathlib import Path
from urllib.parse import quote, urlencode

from attrs import evolve, frozen

from human_relay.sources import open_source
from human_relay.sources.pointer import pointer_socket
from shared.private_socket import private_path
from shared.scenario import Scenario
from shared.uri import parse_uri

POINTER = "pointer"
FASTEST = 3.0
"""A pointer moves no hand faster than this, m/s."""


@frozen(kw_only=True)
class HandChoice:
    """The hand of a flight.

    Attributes:
        uri: Hand source of the relay.
        takeover: Pointer that may take it over, None for none.
        pointer: Socket of the pointer, empty without one.
        remarks: What is to be known about it: what was left out of a recording, and why.
    """

    uri: str
    takeover: str | None = None
    pointer: str = ""
    remarks: tuple[str, ...] = ()


def choose_hand(uri: str, scenario: Scenario, *, console: bool) -> HandChoice:
    """Completes what the user asked for.

    Args:
        uri: The hand source; `pointer://` needs no socket.
        scenario: Whose `[hand]` says how fast the mapped hand follows: a pointer moves the hand no faster.
        console: Whether pages may take over any other hand.

    Raises:
        ConfigError: The source is refused; so nothing is started for it.
        DeviceError: Another relay listens on the socket that it names, or there can be no socket.
    """
    parsed = parse_uri(uri, example="scripted:tour?peak=0.4")
    choice = HandChoice(uri=uri)
    if parsed.scheme == POINTER:
        named = private_path(pointer_socket(parsed)) if parsed.path else _own_socket()
        options = {"speed": f"{_speed(scenario):g}", **parsed.options}
        choice = HandChoice(uri=_pointer_uri(named, options), pointer=str(named))
    elif console:
        own = _own_socket()
        takeover = _pointer_uri(own, {"speed": f"{_speed(scenario):g}"})
        choice = evolve(choice, takeover=takeover, pointer=str(own))
    if choice.takeover:
        open_source(choice.takeover, start_ns=0).close()
    with closing(open_source(choice.uri, start_ns=0)) as source:
        return evolve(choice, remarks=source.remarks)


def _own_socket() -> Path:
    """Every flight has one of its own, wherever its processes are started from."""
    return private_path(f"pointer-{os.getpid()}.sock")


def _pointer_uri(socket: Path, options: dict[str, str]) -> str:
    # A percent sign is one (`shared.uri`).
    return f"{POINTER}://{quote(str(socket), safe='/%')}?{urlencode(options)}"


def _speed(scenario: Scenario) -> float:
    hand = scenario.hand
    return min(hand.max_speed / (hand.gain if hand.mapping == "relative" else 1.0), FASTEST)
