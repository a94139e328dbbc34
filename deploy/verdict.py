"""Whether a flight did what was asked of it, real or simulated; and if not, why, in sentences. Pure."""

from collections.abc import Mapping, Sequence

_NAMED = 8
"""Of more drones only so many are named."""


def contacts(referee: Mapping[str, float]) -> list[str]:
    """Says what the referee counted.

    Args:
        referee: `collisions` and `fence_exits`, empty without a simulated world.
    """
    numbers = {"collisions": "collisions", "fence_exits": "times out of the fence"}
    return [f"{referee[key]:.0f} {text}" for key, text in numbers.items() if referee.get(key)]


def absences(
    followed: Mapping[int, bool], *, heard: bool, asked: bool, rejected: int, early: bool = False
) -> list[str]:
    """Says who did not follow a hand that asked for it; where a hand never did, nobody is to blame.

    Args:
        followed: By drone, whether it was ever in FOLLOW.
        heard: Whether there was a hand at all.
        asked: Whether a hand sample with the wish FLY was ever sent.
        rejected: How many poses of the hand the relay refused as impossible.
        early: Whether it was called off before anybody could be expected to follow.
    """
    if not heard:
        return ["nobody flew: no hand was ever heard; its log is relay.log"]
    if not asked:
        return [f"nobody flew: all poses of the hand are impossible ({rejected}); metres?"] if rejected else []
    absent = [drone for drone, has in followed.items() if not has]
    if not absent or early:
        return []
    return [f"the hand asked, but {_named(absent)} never followed it"]


def landing(stopped: Sequence[int], *, landed: bool) -> list[str]:
    """Says that a flight did not end with a landing, and why.

    Args:
        stopped: Drones whose motors an emergency stop has cut.
        landed: Whether every drone was seen on the ground, and none was stopped.
    """
    if landed:
        return []
    if stopped:
        return [f"it was ended by STOP: the motors of {_named(stopped)} were cut, wherever they were"]
    return ["not every drone was seen to land"]


def _named(drones: Sequence[int]) -> str:
    names = ", ".join(map(str, drones[:_NAMED]))
    more = f" and {len(drones) - _NAMED} more" if len(drones) > _NAMED else ""
    return f"drone{'s' * (len(drones) > 1)} {names}{more}"
