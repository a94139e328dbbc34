"""What stands in for a reference that is gone: the goal that its own row would give (DESIGN section 5).

A drone keeps the rows of all its ancestors in the reference graph. Once a reference is silent for too long, or
lands by itself, its place is computed from its own references and links, up to the human if need be. A stand-in
takes over, and gives back, step by step within a second; who returns has to be heard for a while first.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

from agents.control import modes
from agents.control.goals import Guide, Row, goal_of
from agents.control.hand import MappedHand
from agents.control.impedance import AT_REST, LinkState, step_links
from agents.control.vectors import Vector, norm
from shared.messages import Mode

REFERENCE_LOST: Final = 0.5
"""A reference unheard for this long is lost, s."""
EXTRAPOLATION: Final = 0.25
"""A silent reference is extrapolated by at most this, m."""
BLEND: Final = 1.0
"""A stand-in takes over, and gives back, within this time, s."""
RETURN_AFTER: Final = 1.0
"""A reference that is back is trusted after it has been heard for this long, s."""


@final
@dataclass(frozen=True)
class Kin:
    """One ancestor in the reference graph.

    Attributes:
        drone: Its number.
        row: Its row of the formation.
        references: Its own references, as places in the tuple of kin.
    """

    drone: int
    row: Row
    references: tuple[int, ...]


@final
class Reference(Guide):
    """An ancestor as last heard: its position (`paper`) or goal (`stable`), goal velocity and mode.

    Attributes:
        velocity: How fast its point moves, m/s.
        age: Time since its sample arrived, s.
        fresh: Whether the sample is newer than the one of the last step.
    """

    def __init__(
        self, point: Vector, goal_velocity: Vector, mode: Mode, velocity: Vector, age: float, *, fresh: bool
    ) -> None:
        super().__init__(point, goal_velocity, mode)
        self.velocity: Final = velocity
        self.age: Final = age
        self.fresh: Final = fresh


@final
class StandIn:
    """How far an ancestor has been replaced.

    Attributes:
        share: 0: it speaks for itself; 1: its stand-in does.
        heard_for: How long it has been fit to lead again without a gap, s.
        links: Its links, simulated while the stand-in has a share.
    """

    def __init__(self, share: float, heard_for: float, links: tuple[LinkState, ...]) -> None:
        self.share: Final = share
        self.heard_for: Final = heard_for
        self.links: Final = links


def is_fit(reference: Reference | None) -> bool:
    """Says whether an ancestor is heard and part of the formation."""
    return reference is not None and reference.age <= REFERENCE_LOST and modes.is_guided(reference.mode)


def is_gone(reference: Reference | None) -> bool:
    """Says whether an ancestor needs a stand-in."""
    if reference is None or reference.age > REFERENCE_LOST:
        return True
    # It no longer shows where the formation goes.
    return reference.mode is modes.LAND or reference.mode is modes.STOP


def replace_lost(
    stand_ins: tuple[StandIn, ...],
    kin: tuple[Kin, ...],
    heard: list[Reference | None],
    hand_velocity: Vector,
    dt: float,
) -> tuple[StandIn, ...]:
    """Advances every ancestor's stand-in by one step.

    Args:
        stand_ins: Before, one per ancestor; none while all speak for themselves.
        kin: The ancestors.
        heard: What is known of each; None where never heard.
        hand_velocity: Mapped hand velocity in the formation's frame, m/s.
        dt: Time since the last step, s.
    """
    after = []
    replaced = False
    for place, each in enumerate(kin):
        stand_in = stand_ins[place] if stand_ins else _absent(each)
        if stand_in.share > 0.0 or is_gone(heard[place]):
            stand_in = _advance(stand_in, each, heard[place], hand_velocity, dt)
            replaced = replaced or stand_in.share > 0.0
        after.append(stand_in)
    return tuple(after) if replaced else ()


def _absent(kin: Kin) -> StandIn:
    return StandIn(0.0, 0.0, (AT_REST,) * len(kin.row.links))


def _advance(
    stand_in: StandIn, kin: Kin, reference: Reference | None, hand_velocity: Vector, dt: float
) -> StandIn:
    share, heard_for = stand_in.share, stand_in.heard_for
    heard_for = heard_for + dt if is_fit(reference) else 0.0
    if reference is None:
        share = 1.0  # nothing to blend from: it was never there
    elif is_gone(reference) or heard_for < RETURN_AFTER:
        share = min(share + dt / BLEND, 1.0)
    else:
        share -= dt / BLEND
    if share <= 0.0:
        return _absent(kin)
    return StandIn(share, heard_for, step_links(stand_in.links, kin.row.links, hand_velocity, dt))


def guides(
    stand_ins: tuple[StandIn, ...],
    kin: tuple[Kin, ...],
    heard: list[Reference | None],
    wanted: int,
    hand: MappedHand,
) -> list[Guide | None]:
    """Returns whom to follow in the places of the first `wanted` ancestors, the direct references.

    Args:
        stand_ins: One per ancestor.
        kin: The ancestors.
        heard: What is known of each.
        wanted: How many of them are direct references.
        hand: The mapped hand, root of the graph.

    Returns:
        None in the place of an ancestor that is neither fit nor replaced: it has not joined yet.
    """
    known: dict[int, Guide | None] = {}
    return [_guide(place, stand_ins, kin, heard, hand, known) for place in range(wanted)]


def _guide(
    place: int,
    stand_ins: tuple[StandIn, ...],
    kin: tuple[Kin, ...],
    heard: list[Reference | None],
    hand: MappedHand,
    known: dict[int, Guide | None],
) -> Guide | None:
    if place not in known:
        reference, share = heard[place], stand_ins[place].share
        own = _own(reference) if reference is not None and share > 0.0 else guide_of(reference)
        if share > 0.0:
            behind = [_guide(p, stand_ins, kin, heard, hand, known) for p in kin[place].references]
            own = _blend(own, _stand_in(kin[place], stand_ins[place].links, behind, hand), share)
        known[place] = own
    return known[place]


def all_follow(lead: list[Guide]) -> bool:
    """Says whether everybody whom a drone follows is in FOLLOW."""
    return all(guide.mode is modes.FOLLOW for guide in lead)


def guide_of(reference: Reference | None) -> Guide | None:
    """Returns an ancestor that speaks for itself, None unless it is fit."""
    return _own(reference) if reference is not None and is_fit(reference) else None


def _own(reference: Reference) -> Guide:
    if reference.fresh:
        return reference
    return Guide(_extrapolated(reference), reference.goal_velocity, reference.mode)


def _stand_in(
    kin: Kin, links: tuple[LinkState, ...], behind: list[Guide | None], hand: MappedHand
) -> Guide | None:
    """Returns the goal of an ancestor by its own row, None if one of its references has not joined yet."""
    present = [guide for guide in behind if guide is not None]
    if len(present) < len(behind):
        return None
    point, velocity = goal_of(kin.row, links, hand, present)
    return Guide(point, velocity, modes.FOLLOW if all_follow(present) else modes.HOLD)


def _blend(own: Guide | None, stand_in: Guide | None, share: float) -> Guide | None:
    if own is None or stand_in is None:
        return stand_in
    return Guide(
        _between(own.point, stand_in.point, share),
        _between(own.goal_velocity, stand_in.goal_velocity, share),
        stand_in.mode,
    )


def _between(a: Vector, b: Vector, share: float) -> Vector:
    x, y, z = a
    u, v, w = b
    return (x + share * (u - x), y + share * (v - y), z + share * (w - z))


def _extrapolated(reference: Reference) -> Vector:
    """Returns where a silent reference would be by now, at most 0.25 m from where it was last."""
    speed = norm(reference.velocity)
    seconds = min(reference.age, EXTRAPOLATION / speed) if speed > 0.0 else 0.0
    x, y, z = reference.point
    u, v, w = reference.velocity
    return (x + u * seconds, y + v * seconds, z + w * seconds)


def kin_order(references: Mapping[int, Sequence[int]], drone: int) -> tuple[int, ...]:
    """Returns a drone's ancestors, its direct references first, each once.

    Args:
        references: The reference drones of every drone; a DAG.
        drone: Whose ancestors.
    """
    order = list(references[drone])
    for each in order:
        order += [other for other in references[each] if other not in order]
    return tuple(order)
