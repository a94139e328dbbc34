"""Gloves by URI: one row per backend, imported only when it is used."""

import importlib
from typing import cast
from urllib.parse import unquote, urlsplit

from glove_bridge.gloves.base import Glove
from shared.errors import ConfigError

BACKENDS = {
    "none": ("glove_bridge.gloves.absent", "AbsentGlove"),
    "terminal": ("glove_bridge.gloves.terminal", "TerminalGlove"),
    "record": ("glove_bridge.gloves.record", "RecordGlove"),
    "screen": ("glove_bridge.gloves.screen", "ScreenGlove"),
}
"""Scheme -> module and class; the class is called with what follows `scheme://`."""


def open_glove(uri: str) -> Glove:
    """Opens a glove.

    Args:
        uri: For example `terminal://` or `record://patterns.jsonl`.

    Raises:
        ConfigError: Unknown scheme, or a URI that its backend cannot use.
    """
    parts = urlsplit(uri)
    if parts.scheme not in BACKENDS or "://" not in uri:
        known = ", ".join(f"{scheme}://" for scheme in BACKENDS)
        raise ConfigError(f"glove {uri!r}: no such backend; known: {known}")
    module, name = BACKENDS[parts.scheme]
    backend = getattr(importlib.import_module(module), name)
    return cast(Glove, backend(unquote(parts.netloc + parts.path)))
