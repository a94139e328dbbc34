"""Gloves by URI: one row per backend, imported only when it is used."""

import importlib
from typing import cast

from glove_bridge.gloves.base import Glove, GloveBackend
from shared.errors import ConfigError
from shared.uri import Uri, parse_uri

BACKENDS = {
    "none": ("glove_bridge.gloves.absent", "AbsentGlove"),
    "terminal": ("glove_bridge.gloves.terminal", "TerminalGlove"),
    "record": ("glove_bridge.gloves.record", "RecordGlove"),
    "serial": ("glove_bridge.gloves.serial", "SerialGlove"),
    "screen": ("glove_bridge.gloves.screen", "ScreenGlove"),
}
"""Scheme -> module and class; the class is called with the `Uri`."""


def open_glove(uri: str) -> Glove:
    """Opens a glove.

    Args:
        uri: For example `terminal://`, `record://patterns.jsonl` or `serial:///dev/ttyACM0`.

    Raises:
        ConfigError: Unknown scheme, or a URI that its backend cannot use.
    """
    backend, parsed = _backend(uri)
    return backend(parsed)


def check_glove(uri: str) -> None:
    """Refuses what `open_glove` would refuse, and touches no device; errors as there."""
    backend, parsed = _backend(uri)
    backend.check(parsed)


def _backend(uri: str) -> tuple[GloveBackend, Uri]:
    scheme, separator, _ = uri.partition("://")
    if scheme not in BACKENDS or not separator:
        known = ", ".join(f"{scheme}://" for scheme in BACKENDS)
        raise ConfigError(f"glove {uri!r}: no such backend; known: {known}")
    module, name = BACKENDS[scheme]
    backend = cast(GloveBackend, getattr(importlib.import_module(module), name))
    return backend, parse_uri(uri, example="serial:///dev/ttyACM0?baud=115200")
