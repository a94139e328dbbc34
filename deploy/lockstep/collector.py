"""Python's garbage collector and simulations."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def no_collector() -> Iterator[None]:
    """Keeps the collector out of a simulation.

    What the law and the bodies make has no cycles, so the collector finds nothing; but with 10,000 drones it
    takes as long to look it through as to fly them.
    """
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if before:
            gc.enable()
