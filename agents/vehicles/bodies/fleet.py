"""A swarm of bodies of mixed types as one value: rows in the order of the drones' numbers given."""

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet

import numpy as np
import numpy.typing as npt
from attrs import evolve, field, frozen

from agents.vehicles.base import Pose
from agents.vehicles.bodies.advance import BODIES, advance
from agents.vehicles.bodies.pid import hovering
from agents.vehicles.bodies.state import AIRBORNE_HEIGHT, BodyState, Commands, Mask, Vec, at_rest

Rows = npt.NDArray[np.intp]


@frozen(eq=False)
class Group:
    """The bodies of one type: their rows in the fleet and their state."""

    body: str
    rows: Rows
    state: BodyState


@frozen(eq=False)
class Fleet:
    """N bodies at one instant; `advance_fleet` gives the next one.

    Attributes:
        ids: Numbers of the drones, one per row.
        position: (N, 3) world frame, m.
        velocity: (N, 3) world frame, m/s.
        groups: Bodies by type.
        held: Drones that a hand holds in place.
    """

    ids: tuple[int, ...]
    position: Vec
    velocity: Vec
    groups: tuple[Group, ...]
    held: AbstractSet[int] = field(factory=frozenset)

    @property
    def airborne(self) -> Mask:
        """(N,) which bodies are clear of the ground."""
        return self.position[:, 2] > AIRBORNE_HEIGHT


def park_fleet(bodies: Mapping[int, str], positions: Vec) -> Fleet:
    """Places a fleet at rest with motors off.

    Args:
        bodies: Number of each drone -> its type, a key of `BODIES`; the order is that of the rows.
        positions: (N, 3) world frame, m.
    """
    kinds = np.array(list(bodies.values()))
    parked = at_rest(positions)
    groups = tuple(
        Group(body, rows, at_rest(positions[rows]))
        for body in BODIES
        if (rows := np.flatnonzero(kinds == body)).size
    )
    return Fleet(tuple(bodies), parked.position, parked.velocity, groups)


def hover_fleet(fleet: Fleet) -> Fleet:
    """Returns the same fleet in a steady hover where it is."""
    groups = tuple(evolve(group, state=hovering(fleet.position[group.rows])) for group in fleet.groups)
    return evolve(fleet, groups=groups)


def hold(fleet: Fleet, drones: AbstractSet[int]) -> Fleet:
    """Holds exactly these drones in place, by hand, until told otherwise."""
    return evolve(fleet, held=frozenset(drones))


def advance_fleet(fleet: Fleet, commands: Commands, duration: float) -> Fleet:
    """Advances every body with the commands held.

    Args:
        fleet: N bodies.
        commands: One per row.
        duration: s, >= 0.
    """
    position, velocity = np.empty_like(fleet.position), np.empty_like(fleet.velocity)
    groups = []
    for group in fleet.groups:
        rows = group.rows
        own = Commands(commands.kind[rows], commands.setpoint[rows])
        state = advance(BODIES[group.body], group.state, own, duration)
        if fleet.held:
            state = _held_back(group.state, state, _rows_of(fleet.ids, rows, fleet.held))
        position[rows], velocity[rows] = state.position, state.velocity
        groups.append(Group(group.body, rows, state))
    return Fleet(fleet.ids, position, velocity, tuple(groups), fleet.held)


def poses(fleet: Fleet, charge: Sequence[float], seq: int) -> list[Pose]:
    """Returns what each vehicle reports, one per row.

    Args:
        fleet: The bodies now.
        charge: (N,) of their batteries, 0..1.
        seq: Number of this report.
    """
    rows = zip(
        map(tuple, fleet.position.tolist()),
        map(tuple, fleet.velocity.tolist()),
        charge,
        fleet.airborne.tolist(),
        strict=True,
    )
    return [Pose(position, velocity, 0.0, left, airborne, seq) for position, velocity, left, airborne in rows]


def _rows_of(ids: Sequence[int], rows: Rows, held: AbstractSet[int]) -> Mask:
    return np.array([ids[row] in held for row in rows])


def _held_back(before: BodyState, after: BodyState, held: Mask) -> BodyState:
    fixed = held[:, None]
    return after._replace(
        position=np.where(fixed, before.position, after.position),
        velocity=np.where(fixed, 0.0, after.velocity),
    )
