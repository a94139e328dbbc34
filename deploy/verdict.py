"""Whether a flight did what was asked of it, real or simulated; and if not, why, in sentences. Pure."""

from collections.abc import Mapping

_NAMED = 8
"""Of more drones only so many are named."""


def contacts(referee: Mapping[str, float]) -> list[str]:
    """Says what the referee counted.

    Args:
        referee: `collisions` and `fence_exits`, empty without a simulated world.
    """
    numbers = {"collisions": "collisions", "fence_exits": "times out of the fence"}
    return [f"{referee[key]:.0f} {text}" for key, text in numbers.items() if referee.get(key)]


def absences(followed: Mapping[int, bool], *, asked: bool, rejected: int) -> list[str]:
    """Says who did not follow a hand that asked for it; where no hand ever did, nobody is to blame.

    Args:
        followed: By drone, whether it was ever in FOLLOW.
        asked: Whether a hand sample with the wish FLY was ever sent.
        rejected: How many poses of the hand the relay refused as impossible.
    """
    if not asked:
        return [f"nobody flew: all poses of the hand are impossible ({rejected}); metres?"] if rejected else []
    absent = [drone for drone, has in followed.items() if not has]
    if not absent:
        return []
    names = ", ".join(map(str, absent[:_NAMED]))
    more = f" and {len(absent) - _NAMED} more" if len(absent) > _NAMED else ""
    return [f"the hand asked, but drone{'s' * (len(absent) > 1)} {names}{more} never followed it"]
