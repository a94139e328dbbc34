"""What a flight came to: the worst of each class, by the referee's rules, over all ticks at once. Pure.

Who cannot help it is not judged: two bodies that cannot move, a hand and a drone that does not know where it
is, or that no vehicle of its kind could have fled from (`deploy.falsify.escape`). Where a limit was broken
while nobody could help it, or from the beginning, it is judged again once it has been kept.
"""

import math
from typing import Literal

import numpy as np
from attrs import frozen

from agents.vehicles.bodies.state import AIRBORNE_HEIGHT
from agents.vehicles.world.referee import Rules
from deploy.falsify.escape import Chase, beyond_help
from deploy.falsify.swarm import Flown
from shared.arrays import Mask, Vec
from shared.cylinders import Cylinder

Kind = Literal["drones", "hand", "column", "fence_x", "fence_y", "fence_z", "floor"]


@frozen
class Class:
    """What is looked at.

    Attributes:
        label: For people.
        limit: m.
        above: Whether the value must not fall below the limit, or not exceed it.
    """

    label: str
    limit: float
    above: bool = True

    def margin(self, value: float) -> float:
        """Returns how far a value is from its limit, m; negative: it is broken."""
        return value - self.limit if self.above else self.limit - value


CLASSES: dict[Kind, Class] = {
    "drones": Class("between two bodies", 0.20),
    "hand": Class("from the hand to a body", 0.25),
    "column": Class("from a column's surface to a body's centre", 0.06),
    "fence_x": Class("out of the fence along x", 0.02, above=False),
    "fence_y": Class("out of the fence along y", 0.02, above=False),
    "fence_z": Class("out of the fence along z", 0.02, above=False),
    "floor": Class("height of a drone that follows or holds", AIRBORNE_HEIGHT),
}


@frozen
class Worst:
    """The worst of one class.

    Attributes:
        value: m; infinite in the good direction where nothing was ever judged.
        t: When, s.
        drones: Whose.
    """

    value: float
    t: float = 0.0
    drones: tuple[int, ...] = ()


Verdict = dict[Kind, Worst]


def judge(flown: Flown, rules: Rules) -> Verdict:
    """Returns the worst of each class.

    Args:
        flown: The flight.
        rules: Columns, fence and numbers of the drones.
    """
    position, ids = flown.position, rules.ids
    airborne = position[..., 2] > AIRBORNE_HEIGHT
    flying = airborne & flown.able
    low, high = rules.fence
    out = np.maximum(low - position, position - high)
    hand = np.linalg.norm(position - flown.hand[:, None], axis=2)
    fair = flying & flown.hearing & ~_beyond_help(flown, hand, rules)
    found: Verdict = {
        "drones": _pairs(flown, airborne, ids),
        "hand": _judged("hand", hand, fair, flown.t, ids),
        "column": _judged("column", _column_gaps(position, rules), flying, flown.t, ids),
        "floor": _judged("floor", position[..., 2], flown.guided, flown.t, ids),
    }
    axes: tuple[Kind, ...] = ("fence_x", "fence_y", "fence_z")
    for axis, kind in enumerate(axes):
        found[kind] = _judged(kind, out[..., axis], flying, flown.t, ids)
    return found


def broken(verdict: Verdict) -> list[Kind]:
    """Returns the classes whose limit was broken."""
    return [kind for kind, worst in verdict.items() if CLASSES[kind].margin(worst.value) < 0.0]


def _beyond_help(flown: Flown, hand: Vec, rules: Rules) -> Mask:
    """Returns whom no vehicle of its kind could have saved from the hand, (T, N)."""
    keep = CLASSES["hand"].limit
    near = hand < keep
    found = np.zeros_like(near)
    for row, vehicle in enumerate(flown.vehicles):
        if near[:, row].any():
            body = flown.position[:, row]
            chase = Chase(t=flown.t, hand=flown.hand, body=body, vehicle=vehicle, rules=rules)
            found[:, row] = beyond_help(chase, near[:, row], keep)
    return found


def _pairs(flown: Flown, airborne: Mask, ids: tuple[int, ...]) -> Worst:
    """Judges the pairs of which one is in the air, and one can keep away from the other."""
    position = flown.position
    worst = Worst(math.inf)
    for row in range(len(ids) - 1):
        gaps = np.linalg.norm(position[:, row + 1 :] - position[:, row, None], axis=2)
        counts = (airborne[:, row + 1 :] | airborne[:, row, None]) & (
            flown.able[:, row + 1 :] | flown.able[:, row, None]
        )
        nearest = _judged("drones", gaps, counts, flown.t, ids[row + 1 :])
        if nearest.value < worst.value:
            worst = Worst(nearest.value, nearest.t, (ids[row], *nearest.drones))
    return worst


def _column_gaps(position: Vec, rules: Rules) -> Vec:
    """(T, N) distances from the nearest column's surface, m."""
    gaps = np.full(position.shape[:2], np.inf)
    for column in rules.columns:
        np.minimum(gaps, _surface_gaps(position, column), out=gaps)
    return gaps


def _surface_gaps(position: Vec, cylinder: Cylinder) -> Vec:
    """Does what `Cylinder.gap` does, (T, N), m."""
    aside = np.hypot(position[..., 0] - cylinder.x, position[..., 1] - cylinder.y) - cylinder.radius
    beyond = np.maximum(cylinder.low - position[..., 2], position[..., 2] - cylinder.high)
    return np.where(beyond <= 0.0, aside, np.hypot(np.maximum(aside, 0.0), np.maximum(beyond, 0.0)))


def _judged(kind: Kind, values: Vec, counts: Mask, t: Vec, ids: tuple[int, ...]) -> Worst:
    """Returns the worst of a class, (T, N), where it counts and since it was last kept."""
    judged = CLASSES[kind]
    sign = 1.0 if judged.above else -1.0
    bad = sign * (values - judged.limit) < 0.0
    if bad.any():
        counts = counts & ~_not_begun_there(bad, counts)
    worst = _lowest(sign * values, counts, t, ids)
    return Worst(sign * worst.value, worst.t, worst.drones)


def _not_begun_there(bad: Mask, counts: Mask) -> Mask:
    """Returns where a limit has been broken without a break since it did not count, or since the beginning."""
    found = np.zeros_like(bad)
    found[0] = bad[0]
    for tick in range(1, len(bad)):
        found[tick] = bad[tick] & (found[tick - 1] | ~counts[tick])
    return found


def _lowest(values: Vec, counts: Mask, t: Vec, ids: tuple[int, ...]) -> Worst:
    counted = np.where(counts, values, np.inf)
    if not counted.size:
        return Worst(math.inf)
    tick, row = np.unravel_index(np.argmin(counted), counted.shape)
    value = float(counted[tick, row])
    return Worst(value, float(t[tick]), (ids[row],)) if value < math.inf else Worst(math.inf)
