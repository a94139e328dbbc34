"""The conditions of a drone in words, the same wherever they are shown. Pure."""

from shared.messages import DroneState, Flag


def conditions(state: DroneState, only: Flag | None = None) -> list[str]:
    """Returns the flags of a state in words; one that waits says for whom.

    Args:
        state: Of any drone.
        only: The flags that are of interest; None for all.
    """
    shown = state.flags if only is None else state.flags & only
    return [_word(flag, state) for flag in Flag if flag.name and flag in shown]


def _word(flag: Flag, state: DroneState) -> str:
    if flag is Flag.WAITING and state.unheard:
        return f"waits for {', '.join(map(str, state.unheard))}"
    return str(flag.name).lower().replace("_", " ")
