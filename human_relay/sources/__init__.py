"""Hand sources by URI: one row per backend, imported only when it is used."""

import importlib
from contextlib import closing
from typing import cast

from human_relay.sources.base import HandBackend, HandSource
from human_relay.sources.playback import Playback
from shared.errors import ConfigError
from shared.uri import Uri, parse_uri

BACKENDS = {
    "scripted": ("human_relay.sources.scripted", "ScriptedHand"),
    "recording": ("human_relay.sources.recording", "RecordedHand"),
    "pointer": ("human_relay.sources.pointer", "PointerHand"),
}
_EXAMPLE = "scripted:tour?peak=0.4"


def open_source(uri: str, start_ns: int) -> HandSource:
    """Opens a hand source.

    Args:
        uri: For example `scripted:tour` or `recording:flights/S2_visual_1?speed=0.5`.
        start_ns: When the source's own time starts, on the clock of the process.

    Raises:
        ConfigError: Unknown scheme or option, or a file that is missing or wrong.
        DeviceError: What it listens on is in use.
    """
    parsed = parse_uri(uri, example=_EXAMPLE)
    return _backend(parsed)(parsed, start_ns)


def source_hints(uri: str) -> dict[str, object]:
    """Returns what a source knows about the mapping from its hand to the formation.

    Args:
        uri: As for `open_source`; the source is not started.

    Returns:
        Dotted scenario keys and values, for example `{"hand.gain": 2.0}`; empty if it knows nothing.

    Raises:
        ConfigError: As for `open_source`.
    """
    parsed = parse_uri(uri, example=_EXAMPLE)
    return _backend(parsed).hints(parsed)


def source_remarks(uri: str) -> tuple[str, ...]:
    """Returns what is to be known about a source before it flies; errors as for `open_source`."""
    with closing(open_source(uri, 0)) as source:
        return source.remarks


def plays_by_itself(uri: str) -> bool:
    """Says whether a source needs nobody who moves something while it runs.

    Raises:
        ConfigError: As for `open_source`.
    """
    backend = _backend(parse_uri(uri, example=_EXAMPLE))
    return isinstance(backend, type) and issubclass(backend, Playback)


def _backend(uri: Uri) -> HandBackend:
    if uri.scheme not in BACKENDS:
        known = ", ".join(f"{scheme}:" for scheme in BACKENDS)
        raise ConfigError(f"{uri.text}: unknown hand source {uri.scheme!r}; known ones: {known}")
    module, name = BACKENDS[uri.scheme]
    return cast(HandBackend, getattr(importlib.import_module(module), name))
