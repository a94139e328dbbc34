"""Gloves by URI: one row per backend, imported only when it is used."""

import importlib
from typing import cast

from glove_bridge.gloves.base import Glove
from shared.errors import ConfigError
from shared.uri import parse_uri

BACKENDS = {
    "none": ("glove_bridge.gloves.absent", "AbsentGlove"),
    "terminal": ("glove_bridge.gloves.terminal", "TerminalGlove"),
    "record": ("glove_bridge.gloves.record", "RecordGlove"),
    "serial": ("glove_bridge.gloves.serial", "SerialGlove"),
}
"""Scheme -> module and class; the class is called with the `Uri`."""


def open_glove(uri: str) -> Glove:
    """Opens a glove.

    Args:
        uri: For example `terminal://`, `record://patterns.jsonl` or `serial:///dev/ttyACM0`.

    Raises:
        ConfigError: Unknown scheme, or a URI that its backend cannot use.
    """
    scheme, separator, _ = uri.partition("://")
    if scheme not in BACKENDS or not separator:
        known = ", ".join(f"{scheme}://" for scheme in BACKENDS)
        raise ConfigError(f"glove {uri!r}: no such backend; known: {known}")
    module, name = BACKENDS[scheme]
    backend = getattr(importlib.import_module(module), name)
    return cast(Glove, backend(parse_uri(uri, example="serial:///dev/ttyACM0?baud=115200")))
