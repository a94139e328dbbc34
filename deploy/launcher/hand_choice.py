"""How the relay of a flight gets its hand: from the source that the user names, from a pointer, or both."""

from urllib.parse import urlencode

from attrs import evolve, frozen

from human_relay.sources import open_source
from human_relay.sources.pointer import pointer_address
from shared.pointer_link import LOOPBACK
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
        pointer_port: UDP port of the pointer, 0 without one.
    """

    uri: str
    takeover: str | None = None
    pointer_port: int = 0


def choose_hand(uri: str, scenario: Scenario, *, console: bool, free_port: int) -> HandChoice:
    """Completes what the user asked for.

    Args:
        uri: The hand source; `pointer://` needs no address.
        scenario: Whose `[hand]` says how fast the mapped hand follows: a pointer moves the hand no faster.
        console: Whether pages may take over any other hand.
        free_port: UDP port for a pointer without an address.

    Raises:
        ConfigError: The source is refused; so nothing is started for it.
        DeviceError: The port that it names is in use.
    """
    parsed = parse_uri(uri, example="scripted:tour?peak=0.4")
    if parsed.scheme == POINTER:
        _, port = pointer_address(parsed) if parsed.path else (LOOPBACK, free_port)
        options = {"speed": f"{_speed(scenario):g}", **parsed.options}
        choice = HandChoice(uri=_pointer_uri(port, options), pointer_port=port)
    else:
        choice = HandChoice(uri=uri)
        if console:
            takeover = _pointer_uri(free_port, {"speed": f"{_speed(scenario):g}"})
            choice = evolve(choice, takeover=takeover, pointer_port=free_port)
    open_source(choice.uri, start_ns=0).close()
    return choice


def _pointer_uri(port: int, options: dict[str, str]) -> str:
    return f"{POINTER}://{LOOPBACK}:{port}?{urlencode(options)}"


def _speed(scenario: Scenario) -> float:
    hand = scenario.hand
    return min(hand.max_speed / (hand.gain if hand.mapping == "relative" else 1.0), FASTEST)
