"""Safety cues as text: what the operator has to know, most urgent first. Pure."""

from collections.abc import Collection, Mapping

from observer.console.protocol import Json
from shared.messages import DroneState, Flag, Mode

_AIRBORNE = frozenset({Mode.TAKEOFF, Mode.FOLLOW, Mode.HOLD, Mode.LAND})
_FLAGS = (
    (Flag.CRITICAL_BATTERY, "alarm", "battery critical"),
    (Flag.FENCE, "warning", "at the fence"),
    (Flag.BLOCKED, "warning", "blocked: goal not reached"),
    (Flag.LOW_BATTERY, "warning", "battery low"),
    (Flag.OLD_POSE, "warning", "without a fresh pose: place unknown"),
    (Flag.MISSED, "alarm", "cut off from others: holding, then landing"),
    (Flag.REJECTED_INPUT, "warning", "doubtful of what is heard: who says so is in the log"),
)


def notices(
    states: Mapping[int, DroneState], missing: Collection[int], *, hand_silent: bool, hand_jumped: bool = False
) -> list[Json]:
    """Lists the conditions that hold now.

    Args:
        states: The last state of every drone that was ever heard.
        missing: Drones of those that are not heard any more.
        hand_silent: Whether the relay has fallen silent.
        hand_jumped: Whether the hand is said to be where no hand can have come.

    Returns:
        `{level, text}` each; nothing about the hand while everybody is on the ground.
    """
    found = [
        _notice("alarm", f"{_drones([drone])}: STOP, its motors are off")
        for drone, state in sorted(states.items())
        if state.mode is Mode.STOP
    ]
    found += [_notice("alarm", f"{_drones([drone])} is lost") for drone in sorted(missing)]
    if any(state.mode in _AIRBORNE for state in states.values()):
        if hand_silent:
            found.append(_notice("alarm", "the hand is silent: the swarm holds, then lands"))
        elif hand_jumped:
            found.append(_notice("alarm", "the hand jumped: the swarm holds until it moves like a hand again"))
    for flag, level, text in _FLAGS:
        flagged = [i for i, state in sorted(states.items()) if flag in state.flags and i not in missing]
        if flagged:
            found.append(_notice(level, f"{_drones(flagged)} {text}"))
    found += _waiting(states, missing)
    return sorted(found, key=lambda notice: notice["level"] != "alarm")


def _waiting(states: Mapping[int, DroneState], missing: Collection[int]) -> list[Json]:
    """Says for whom drones wait, which do not know where everybody is whom they must avoid."""
    waiting = {i: s for i, s in sorted(states.items()) if Flag.WAITING in s.flags and i not in missing}
    awaited = sorted({other for state in waiting.values() for other in state.unheard})
    if not awaited:
        return []
    verb = "wait" if len(waiting) > 1 else "waits"
    return [_notice("warning", f"{_drones([*waiting])} {verb} to hear {_drones(awaited)}")]


def _drones(ids: list[int]) -> str:
    return f"drone{'s' if len(ids) > 1 else ''} {', '.join(map(str, ids))}"


def _notice(level: str, text: str) -> Json:
    return {"level": level, "text": text}
