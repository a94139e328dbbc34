"""What a simulated run leaves: arrays over ticks, the referee's verdict and a CSV file."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from attrs import field, frozen

from agents.vehicles.bodies.state import AIRBORNE_HEIGHT
from agents.vehicles.world.referee import RefereeState, Rules, report, update
from deploy.lockstep.hand_track import HandTrack
from shared.arrays import Vec
from shared.formation import Formation
from shared.spreadsheet import cell, short


class Moment(NamedTuple):
    """One tick of N drones with L links: bodies as read at the tick, and what was computed from that.

    Attributes:
        position: (N, 3) m.
        goal: (N, 3) before avoidance, m.
        setpoint: (N, 3) m.
        displacement: (L, 3) before its limit, formation frame, m.
    """

    position: Vec
    goal: Vec
    setpoint: Vec
    displacement: Vec


@frozen(kw_only=True)
class Record:
    """A run of T ticks.

    Attributes:
        formation: Who flew.
        hand: The hand and the mapped hand.
        position: (T, N, 3) m.
        goal: (T, N, 3) m.
        setpoint: (T, N, 3) m.
        displacement: (T, L, 3) m.
        followed: The drones that were ever in FOLLOW.
    """

    formation: Formation
    hand: HandTrack
    position: Vec = field(eq=False)
    goal: Vec = field(eq=False)
    setpoint: Vec = field(eq=False)
    displacement: Vec = field(eq=False)
    followed: frozenset[int]


def make_record(
    formation: Formation, hand: HandTrack, moments: Sequence[Moment], followed: Iterable[int]
) -> Record:
    """Stacks the ticks of a run, in order."""
    return Record(
        formation=formation,
        hand=hand,
        followed=frozenset(followed),
        position=np.array([moment.position for moment in moments]),
        goal=np.array([moment.goal for moment in moments]),
        setpoint=np.array([moment.setpoint for moment in moments]),
        displacement=np.array([moment.displacement for moment in moments]),
    )


def judge(record: Record, rules: Rules) -> dict[str, float]:
    """Returns the referee's numbers over the whole run, see `agents.vehicles.world.referee.report`."""
    state = RefereeState()
    ticks = zip(
        *(array.tolist() for array in (record.hand.t, record.position, record.hand.position)), strict=True
    )
    for t, positions, hand in ticks:
        airborne = [z > AIRBORNE_HEIGHT for _, _, z in positions]
        state = update(rules, state, positions, airborne, hand=hand, t=t)
    return report(state)


def tracking_rms(record: Record) -> Vec:
    """Returns how far each body was from its goal, (N,), root mean square over the run, m."""
    error = record.position - record.goal
    rms: Vec = np.sqrt(np.mean(np.sum(error**2, axis=2), axis=0))
    return rms


def write_csv(record: Record, path: Path) -> None:
    """Writes one row per tick.

    The columns are `t` (s), then x, y and z (m) of each of: `hand`, `mapped` (the mapped hand),
    `p<id>` (body), `g<id>` (goal), `s<id>` (set-point) of every drone, `d<link>` (link displacement before its
    limit, formation frame); for example `p2_y` or `d1-2_x`. Everything in a row belongs to the same tick.
    """
    ids = record.formation.ids
    groups = {"hand": record.hand.position, "mapped": record.hand.point}
    for letter, array in (("p", record.position), ("g", record.goal), ("s", record.setpoint)):
        groups.update({f"{letter}{drone}": array[:, row] for row, drone in enumerate(ids)})
    groups.update({f"d{link.name}": record.displacement[:, i] for i, link in enumerate(record.formation.links)})
    header = ["t", *(f"{name}_{axis}" for name in groups for axis in "xyz")]
    table = np.column_stack([record.hand.t, *groups.values()])
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(map(cell, header))
        writer.writerows(map(short, row) for row in table.tolist())
