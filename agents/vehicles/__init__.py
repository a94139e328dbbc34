"""Vehicle backends, chosen by the scheme of a URI."""

from collections.abc import Callable
from importlib import import_module

from agents.vehicles.base import Vehicle
from shared.errors import ConfigError

BACKENDS = {
    "sim": "agents.vehicles.sim:SimVehicle",
}
"""Scheme -> `module:class`, imported when used; the class is called with the URI."""


def open_vehicle(uri: str) -> Vehicle:
    """Opens the vehicle that a URI names.

    Args:
        uri: For example `sim://127.0.0.1:7400/2`.

    Raises:
        ConfigError: An unknown scheme, or a URI that its backend cannot read.
    """
    scheme = uri.partition("://")[0]
    if scheme not in BACKENDS:
        raise ConfigError(
            f"vehicle {uri!r}: no backend for {scheme!r}; known: {', '.join(f'{s}://' for s in BACKENDS)}"
        )
    module, name = BACKENDS[scheme].split(":")
    backend: Callable[[str], Vehicle] = getattr(import_module(module), name)
    return backend(uri)
