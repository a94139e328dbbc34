"""The virtual clock: ticks at the control rate, in whole nanoseconds."""

from shared.clock import NS_PER_S


def tick_ns(tick: int, rate_hz: float) -> int:
    """Returns when a tick is, ns since the start."""
    return round(tick * NS_PER_S / rate_hz)


def tick_length(tick: int, rate_hz: float) -> float:
    """Returns the time from a tick to the next one, s."""
    return (tick_ns(tick + 1, rate_hz) - tick_ns(tick, rate_hz)) / NS_PER_S
