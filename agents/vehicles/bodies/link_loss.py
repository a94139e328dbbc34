"""What a vehicle does on its own when its commands stop coming: a pure function of their age."""

from agents.vehicles.bodies.state import Command, Kinds, Mask, Vec

LEVEL_AFTER = 0.5
CUT_AFTER = 2.0
"""Ages at which the Crazyflie firmware levels and cuts, s (research: crazyflie commander)."""


def apply_link_loss(kind: Kinds, age: Vec, hovers: Mask) -> Kinds:
    """Replaces the commands of vehicles that have lost their link.

    Args:
        kind: (N,) last `Command` that each vehicle got.
        age: (N,) time since then, s; infinite if there never was one.
        hovers: (N,) vehicles that hold their last command for ever (rule `hover`); the others follow the
            Crazyflie firmware (rule `crazyflie`).

    Returns:
        (N,) the `Command` that each vehicle obeys now.
    """
    lost = ~hovers & (kind != Command.CUT.value)
    obeyed = kind.copy()
    obeyed[lost & (age >= LEVEL_AFTER)] = Command.LEVEL
    obeyed[lost & (age >= CUT_AFTER)] = Command.CUT
    return obeyed
