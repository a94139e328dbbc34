"""Generators of formation geometries: who refers to whom, and where it flies relative to them.

Formation frame: the human looks along -x, right is +y, z up. Formations fly in front of the hand (the human
pushes them ahead), so offsets point along -x.
"""

import math

from shared.scenario import Drone, FormationSettings

HUMAN = "human"


def generate(settings: FormationSettings) -> tuple[Drone, ...]:
    """Makes the drones of a shape.

    Args:
        settings: Shape, number, spacing L (along x) and width H (across), m.

    Returns:
        One `Drone` per drone, ids 1..n; `custom` returns what the scenario lists.
    """
    if settings.shape == "custom" or settings.drones:
        return settings.drones
    return _GENERATORS[settings.shape](settings)


def _rhombus(s: FormationSettings) -> tuple[Drone, ...]:
    """The paper's four drones, Eqs. 11-13: 1 <- human, 2 and 3 <- 1, 4 <- mean(2, 3)."""
    return (
        Drone(id=1, references=(HUMAN,), offset=(-s.spacing, 0.0, 0.0)),
        Drone(id=2, references=("1",), offset=(-s.spacing, s.width, 0.0)),
        Drone(id=3, references=("1",), offset=(-s.spacing, -s.width, 0.0)),
        Drone(id=4, references=("2", "3"), offset=(-s.spacing, 0.0, 0.0)),
    )


def _triangle(s: FormationSettings) -> tuple[Drone, ...]:
    """The recorded flights' three drones; all refer to the human, drone 1 flies at the mapped hand."""
    return (
        Drone(id=1, references=(HUMAN,)),
        Drone(id=2, references=(HUMAN,), offset=(-s.spacing, s.width / 2, 0.0)),
        Drone(id=3, references=(HUMAN,), offset=(-s.spacing, -s.width / 2, 0.0)),
    )


def _line(s: FormationSettings) -> tuple[Drone, ...]:
    """One behind the other along the direction of motion, each refers to the one before it."""
    return tuple(
        Drone(id=i, references=(HUMAN if i == 1 else str(i - 1),), offset=(-s.spacing, 0.0, 0.0))
        for i in range(1, s.n + 1)
    )


def _vee(s: FormationSettings) -> tuple[Drone, ...]:
    """A tip and two arms: even numbers right, odd ones left, each refers to the next one towards the tip."""
    tip = Drone(id=1, references=(HUMAN,), offset=(-s.spacing, 0.0, 0.0))
    arms = (
        Drone(
            id=i,
            references=(str(max(1, i - 2)),),
            offset=(-s.spacing, s.width if i % 2 == 0 else -s.width, 0.0),
        )
        for i in range(2, s.n + 1)
    )
    return (tip, *arms)


def _grid(s: FormationSettings) -> tuple[Drone, ...]:
    """Rows across the direction of motion; each refers to the one before it, the first row to its neighbour."""
    columns = s.columns or math.ceil(math.sqrt(s.n))
    drones = [Drone(id=1, references=(HUMAN,), offset=(-s.spacing, 0.0, 0.0))]
    for i in range(2, s.n + 1):
        row, column = divmod(i - 1, columns)
        if row:
            drones.append(Drone(id=i, references=(str(i - columns),), offset=(-s.spacing, 0.0, 0.0)))
            continue
        # The first row grows to both sides of drone 1, so that the formation stays centred on the hand.
        side = s.width if column % 2 else -s.width
        drones.append(Drone(id=i, references=(str(max(1, i - 2)),), offset=(0.0, side, 0.0)))
    return tuple(drones)


_GENERATORS = {
    "rhombus": _rhombus,
    "triangle": _triangle,
    "line": _line,
    "vee": _vee,
    "grid": _grid,
}
