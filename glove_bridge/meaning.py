"""Which pattern a reading calls for: one function per vocabulary. Pure."""

from collections.abc import Callable

from glove_bridge.formation_state import Reading


def state_pattern(reading: Reading) -> str | None:
    """Chooses from the paper's eight patterns.

    A formation that is out of shape and changing comes first, then its displacement, then a change within the
    regular range. A steady, undisplaced formation is not told: the paper codes changes.

    Returns:
        `EI`, `ED`, `CI`, `CD`, `R`, `L`, `RI`, `RD` or None.
    """
    changing = f"{'CRE'[reading.extent + 1]}{'DI'[reading.trend > 0]}" if reading.trend else None
    if reading.extent and changing:
        return changing
    if reading.side:
        return "R" if reading.side > 0 else "L"
    return changing


def advice_pattern(reading: Reading) -> str | None:
    """Chooses the recommended hand motion: contracted, towards the displacement; extended, the opposite side.

    Returns:
        `CR`, `CL`, `ER`, `EL`; None while the formation is regular or has no side.
    """
    side = reading.side * -reading.extent
    if not side:
        return None
    return f"{'E' if reading.extent > 0 else 'C'}{'R' if side > 0 else 'L'}"


MEANINGS: dict[str, Callable[[Reading], str | None]] = {
    "state": state_pattern,
    "advice": advice_pattern,
}
"""Meaning of a pattern set -> how its pattern is chosen."""
