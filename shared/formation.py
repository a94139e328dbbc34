"""The formation row by row: reference weights, offsets, links, order and rest shape (DESIGN section 4).

A formation is a matrix with rows >= 0 and sum 1 over `[human, drone 1, ..., drone N]`; one agent is one row.
The reference graph must be a DAG rooted at the human. Plain numbers, for agents know no others; as arrays for
reports and figures see `shared.arrays`.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from functools import cached_property

from attrs import frozen

from shared.absence import without
from shared.cells import near_pairs
from shared.errors import ConfigError
from shared.messages import ORIGIN, Vector
from shared.scenario import Drone, Impedance, Scenario
from shared.shapes import HUMAN, generate

Weights = Mapping[int, float]
"""One row: column in `[human, drones...]` -> weight; those that are not in it are 0."""

PAPER_MAX_DEPTH = 4
"""The `paper` law is string-unstable: each hop adds lag and gain (PAPER.md)."""


@frozen(kw_only=True)
class Link:
    """One impedance link into a drone.

    Attributes:
        name: `"from-to"`, with `human` or numbers of drones.
        source: Row of the origin in `[human, drones...]`.
        target: Row of the drone in `[drones...]`.
        mass: M, kg.
        damping: D, N s/m.
        stiffness: K, N/m.
        gain: Kv, N s/m.
        limit: Bound of the displacement per axis, m.
    """

    name: str
    source: int
    target: int
    mass: float
    damping: float
    stiffness: float
    gain: float
    limit: float


@frozen(kw_only=True)
class Formation:
    """A checked formation of N drones.

    Attributes:
        ids: Numbers of the drones, ascending, length N.
        weights: Row by row the reference weights over `[human, drones...]`, by column; they sum to 1.
        offsets: Places relative to the weighted references, formation frame, m.
        links: Every impedance link.
        levels: Rows of the drones by depth: all references of a level are in earlier ones.
        depth: Number of levels.
        rest: Rest shape relative to the mapped hand, formation frame, m.
        correction_scale: Factor on every correction (1 for the paper's law).
    """

    ids: tuple[int, ...]
    weights: tuple[Weights, ...]
    offsets: tuple[Vector, ...]
    links: tuple[Link, ...]
    levels: tuple[tuple[int, ...], ...]
    rest: tuple[Vector, ...]
    correction_scale: float

    @property
    def depth(self) -> int:
        """Hops from the human to the deepest drone."""
        return len(self.levels)

    def row(self, drone: int) -> int:
        """Returns the row of a drone by its number."""
        return self._rows[drone]

    def references(self, drone: int) -> tuple[int, ...]:
        """Returns the numbers of the drones that one refers to directly (the human is not among them)."""
        weights = self.weights[self.row(drone)]
        return tuple(self.ids[column - 1] for column, weight in weights.items() if column and weight)

    def refers_to_human(self, drone: int) -> bool:
        """Says whether a drone refers to the human directly."""
        return self.weights[self.row(drone)].get(0, 0.0) > 0.0

    def ancestors(self, drone: int) -> tuple[int, ...]:
        """Returns the numbers of all drones that one depends on, however indirectly."""
        found: set[int] = set()
        pending = list(self.references(drone))
        while pending:
            ancestor = pending.pop()
            if ancestor not in found:
                found.add(ancestor)
                pending.extend(self.references(ancestor))
        return tuple(sorted(found))

    def links_into(self, drone: int) -> tuple[Link, ...]:
        """Returns the impedance links into one drone."""
        return self._links.get(self.row(drone), ())

    @cached_property
    def radius(self) -> float:
        """Horizontal distance of the outermost drone from the mapped hand at rest, m."""
        return max(math.hypot(x, y) for x, y, _ in self.rest)

    @cached_property
    def _rows(self) -> dict[int, int]:
        return {drone: row for row, drone in enumerate(self.ids)}

    @cached_property
    def _links(self) -> dict[int, tuple[Link, ...]]:
        found: defaultdict[int, tuple[Link, ...]] = defaultdict(tuple)
        for link in self.links:
            found[link.target] += (link,)
        return dict(found)


def build_formation(scenario: Scenario, origin: str = "scenario") -> Formation:
    """Builds and checks the formation of a scenario.

    Args:
        scenario: The scenario.
        origin: File it is from, for messages.

    Returns:
        The formation.

    Raises:
        ConfigError: Double ids, unknown references, a cycle, no path to the human, wrong weights, a `paper`
            law that is too deep, or two drones nearer than the safety distance at rest.
    """
    everybody = sorted(generate(scenario.formation), key=lambda drone: drone.id)
    where = f"{origin}: at key formation"
    _check_ids(everybody, scenario, origin)
    drones = _present(everybody, scenario.formation.absent, where)
    ids = tuple(drone.id for drone in drones)
    columns = _columns(drones)
    weights = tuple(_weight_row(drone, columns, where) for drone in drones)
    offsets = tuple(_floats(drone.offset) for drone in drones)
    levels = _levels(weights, ids, where)
    if scenario.swarm.law == "paper" and len(levels) > PAPER_MAX_DEPTH:
        raise ConfigError(
            f"{where}: the formation is {len(levels)} hops deep; the paper's law is string-unstable and"
            f' flies at most {PAPER_MAX_DEPTH}. Use swarm.law = "stable", or a flatter shape'
        )
    rest = _rest_shape(weights, offsets, levels)
    _check_distances(rest, ids, scenario.limits.safety_distance, where)
    links = _build_links(scenario, drones, columns, where)
    return Formation(
        ids=ids,
        weights=weights,
        offsets=offsets,
        links=links,
        levels=levels,
        rest=rest,
        correction_scale=_correction_scale(scenario, links, weights, levels),
    )


def _check_ids(drones: Sequence[Drone], scenario: Scenario, origin: str) -> None:
    ids, where = [drone.id for drone in drones], f"{origin}: at key formation"
    if not ids:
        raise ConfigError(f"{where}.drones: no drones; list [[formation.drones]] or choose a shape")
    for number, times in Counter(ids).items():
        if times > 1:
            raise ConfigError(f"{where}.drones: id {number} appears {times} times; ids are unique")
    for robot in scenario.vehicles.robots:
        if robot not in map(str, ids):
            raise ConfigError(
                f"{origin}: at key vehicles.robots.{robot}: no such drone; the formation's are"
                f" {', '.join(map(str, ids))}"
            )


def _floats(numbers: Vector) -> Vector:
    x, y, z = map(float, numbers)
    return (x, y, z)


def _present(drones: Sequence[Drone], absent: Sequence[int], where: str) -> Sequence[Drone]:
    """Leaves out who stays away; the formation has to be one with them, too."""
    if not absent:
        return drones
    ids = tuple(drone.id for drone in drones)
    for number in absent:
        if number not in ids:
            raise ConfigError(f"{where}.absent: no drone {number} in this formation; its drones are {ids}")
    if set(absent) == set(ids):
        raise ConfigError(f"{where}.absent: nobody is left to fly")
    _levels(tuple(_weight_row(drone, _columns(drones), where) for drone in drones), ids, where)
    return without(drones, absent)


def _columns(drones: Sequence[Drone]) -> dict[str, int]:
    return {HUMAN: 0} | {str(drone.id): column for column, drone in enumerate(drones, start=1)}


def _weight_row(drone: Drone, columns: Mapping[str, int], where: str) -> Weights:
    where = f"{where}.drones, drone {drone.id}"
    if not drone.references:
        raise ConfigError(f'{where}: no references; refer to "human" or to another drone')
    weights = drone.weights or (1.0 / len(drone.references),) * len(drone.references)
    if len(weights) != len(drone.references) or min(weights) < 0 or abs(sum(weights) - 1.0) > 1e-9:
        raise ConfigError(f"{where}: weights {weights} must be >= 0, one per reference, with sum 1")
    row: defaultdict[int, float] = defaultdict(float)
    for reference, weight in zip(drone.references, weights, strict=True):
        row[_column(reference, columns, where)] += weight
    return dict(sorted(row.items()))


def _column(reference: str, columns: Mapping[str, int], where: str) -> int:
    """Returns the column of a reference in `[human, drones...]`."""
    if reference not in columns:
        known = [int(name) for name in columns if name != HUMAN]
        raise ConfigError(f'{where}: {reference!r} is neither "human" nor a drone of {known}')
    return columns[reference]


def _parents(weights: Weights) -> list[int]:
    """Returns the rows of the drones that one refers to."""
    return [column - 1 for column, weight in weights.items() if column and weight]


def _levels(weights: tuple[Weights, ...], ids: tuple[int, ...], where: str) -> tuple[tuple[int, ...], ...]:
    """Sorts the rows by depth (Kahn); whatever never becomes ready is in, or behind, a cycle."""
    levels: list[tuple[int, ...]] = []
    missing = [len(_parents(row)) for row in weights]
    children = defaultdict(list)
    for row, own in enumerate(weights):
        for parent in _parents(own):
            children[parent].append(row)
    ready = [row for row, count in enumerate(missing) if not count]
    while ready:
        levels.append(tuple(sorted(ready)))
        behind = [child for row in ready for child in children[row]]
        ready = []
        for child in behind:
            missing[child] -= 1
            if not missing[child]:
                ready.append(child)
    if stuck := [ids[row] for row, count in enumerate(missing) if count]:
        raise ConfigError(
            f"{where}.drones: drones {stuck} form a cycle or have no path to the human except through one."
            " Let one of them refer only to the human or to drones outside the cycle"
        )
    return tuple(levels)


def _rest_shape(
    weights: tuple[Weights, ...], offsets: tuple[Vector, ...], levels: tuple[tuple[int, ...], ...]
) -> tuple[Vector, ...]:
    places: dict[int, Vector] = {0: ORIGIN}
    for row in (row for level in levels for row in level):
        x = y = z = 0.0
        for column, weight in weights[row].items():
            a, b, c = places[column]
            x, y, z = x + weight * a, y + weight * b, z + weight * c
        a, b, c = offsets[row]
        places[row + 1] = (x + a, y + b, z + c)
    return tuple(places[row + 1] for row in range(len(offsets)))


def _check_distances(rest: tuple[Vector, ...], ids: tuple[int, ...], smallest: float, where: str) -> None:
    points = [(x, y) for x, y, _ in rest]
    gaps = {(i, j): math.dist(points[i], points[j]) for i, j in near_pairs(points, smallest)}
    nearest = min(gaps, key=gaps.__getitem__, default=None)
    if nearest is not None and gaps[nearest] < smallest:
        one, other = (ids[row] for row in nearest)
        raise ConfigError(
            f"{where}: drones {one} and {other} rest {gaps[nearest]:.3f} m apart, nearer"
            f" than limits.safety_distance = {smallest} m; widen spacing, width or their offsets"
        )


def _build_links(
    scenario: Scenario, drones: Sequence[Drone], columns: Mapping[str, int], where: str
) -> tuple[Link, ...]:
    names = scenario.formation.links
    if names is None:
        names = tuple(f"{reference}-{drone.id}" for drone in drones for reference in drone.references)
    for name, times in Counter(names).items():
        if times > 1:
            raise ConfigError(f"{where}.links: {name!r} appears {times} times; a link is unique")
    special = {settings.name: settings for settings in scenario.impedance.links}
    for name in special:
        if name not in names:
            raise ConfigError(f"{where}: impedance.links names {name!r}, the links are {list(names)}")
    absent = {str(number) for number in scenario.formation.absent}
    names = tuple(name for name in names if absent.isdisjoint(name.split("-")))
    return tuple(_build_link(name, scenario.impedance, special.get(name), columns, where) for name in names)


def _build_link(name: str, default: Impedance, special: object, columns: Mapping[str, int], where: str) -> Link:
    source, separator, target = name.partition("-")
    where = f"{where}.links, {name!r}"
    if not separator or target == HUMAN:
        raise ConfigError(f'{where}: a link is "from-to" with a drone at its end, for example "human-1"')

    def value(key: str) -> float:
        chosen = getattr(special, key, None)
        return float(getattr(default, key) if chosen is None else chosen)

    link = Link(
        name=name,
        source=_column(source, columns, where),
        target=_column(target, columns, where) - 1,
        mass=value("mass"),
        damping=value("damping"),
        stiffness=value("stiffness"),
        gain=value("gain"),
        limit=value("limit"),
    )
    if link.mass <= 0 or link.stiffness <= 0 or link.damping < 0 or link.limit <= 0:
        raise ConfigError(f"{where}: mass, stiffness and limit must be > 0, damping >= 0 ({link})")
    return link


def _correction_scale(
    scenario: Scenario,
    links: tuple[Link, ...],
    weights: tuple[Weights, ...],
    levels: tuple[tuple[int, ...], ...],
) -> float:
    """Bounds the sum of corrections along the deepest path by `total_limit` (`stable` law only)."""
    if scenario.swarm.law == "paper":
        return 1.0
    total = [0.0] * len(weights)
    for link in links:
        total[link.target] += link.limit if link.gain else 0.0
    for row in (row for level in levels for row in level):
        total[row] += max((total[parent] for parent in _parents(weights[row])), default=0.0)
    worst = max(total)
    return min(1.0, scenario.swarm.total_limit / worst) if worst > 0 else 1.0
