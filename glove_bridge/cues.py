"""Safety cues: conditions that the operator has to feel before anything else. Pure."""

from collections.abc import Collection, Mapping
from typing import NamedTuple

from glove_bridge.patterns.schema import CUE_PATTERNS
from shared.messages import DroneState, Flag, Mode

AIRBORNE = frozenset((Mode.TAKEOFF, Mode.FOLLOW, Mode.HOLD, Mode.LAND))

_FLAGS = {
    "HAND_STALE": Flag.HAND_STALE,
    "FENCE": Flag.FENCE,
    "BLOCKED": Flag.BLOCKED,
    "LOW_BATTERY": Flag.LOW_BATTERY | Flag.CRITICAL_BATTERY,
}


class Cue(NamedTuple):
    """One condition; a second lost drone is another one.

    Attributes:
        pattern: Name in the set `cues`.
        drone: Whom it is about, 0 for the swarm.
    """

    pattern: str
    drone: int = 0


def active_cues(
    states: Mapping[int, DroneState], missing: Collection[int], *, hand_stale: bool
) -> tuple[Cue, ...]:
    """Lists the conditions that hold now, the most urgent first.

    A hand that was never heard here is none: this process may just have started. The drones will say so.

    Args:
        states: The last state of every drone that was ever heard, also of those that are missing now.
        missing: Drones of the formation that are not heard.
        hand_stale: Whether the hand has fallen silent, or jumped.

    Returns:
        Nothing while, as far as is known, every drone is on the ground.
    """
    if not any(state.mode in AIRBORNE for state in states.values()):
        return ()
    flags = Flag.HAND_STALE if hand_stale else Flag(0)
    for drone, state in states.items():
        if drone not in missing and state.mode in AIRBORNE:
            flags |= state.flags
    cues = [Cue(name) for name, flag in _FLAGS.items() if flags & flag]
    cues += (Cue("DRONE_LOST", drone) for drone in sorted(missing))
    return tuple(sorted(cues, key=lambda cue: CUE_PATTERNS.index(cue.pattern)))
