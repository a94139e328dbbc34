"""What a vehicle does on its own when its commands stop coming: a pure function of their age."""

from typing import Final

from agents.vehicles.bodies.state import CUT, LEVEL

LEVEL_AFTER: Final = 0.5
CUT_AFTER: Final = 2.0
"""Ages at which the Crazyflie firmware levels and cuts, s (research: crazyflie commander)."""


def obeyed(kind: int, age: float, *, hovers: bool) -> int:
    """Returns the `Command` that a vehicle obeys now.

    Args:
        kind: Last `Command` that it got.
        age: Time since then, s; infinite if there never was one.
        hovers: Whether it holds its last command for ever (rule `hover`) or follows the Crazyflie firmware
            (rule `crazyflie`).
    """
    if hovers or kind == CUT or age < LEVEL_AFTER:
        return kind
    return CUT if age >= CUT_AFTER else LEVEL
