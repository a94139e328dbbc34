"""Goals from references and link corrections: one matrix row per drone (Eqs. 11-13, DESIGN section 4)."""

import numpy as np
import numpy.typing as npt
from attrs import field, frozen

from agents.control.impedance import LinkState
from shared.formation import Formation, Link, Vec


@frozen(kw_only=True)
class Rows:
    """The part of a formation that a computation covers: one row for an agent, all for a simulator.

    Attributes:
        weights: (n, 1 + m) reference weights over `[human, m references]`.
        offsets: (n, 3) m, formation frame.
        links: The L links into these drones.
        targets: (L,) row that each link acts on.
        limits: (L, 1) bound per displacement, m.
        scale: Factor on every correction.
    """

    weights: Vec = field(eq=False)
    offsets: Vec = field(eq=False)
    links: tuple[Link, ...]
    targets: npt.NDArray[np.intp] = field(eq=False)
    limits: Vec = field(eq=False)
    scale: float

    def sum_links(self, terms: Vec) -> Vec:
        """Returns the sums (..., n, k) of terms (..., L, k) over the links into each row."""
        total = np.zeros((*terms.shape[:-2], len(self.offsets), terms.shape[-1]))
        np.add.at(total, (..., self.targets, slice(None)), terms)  # type: ignore[arg-type]  # the stub lacks tuples
        return total


def agent_row(formation: Formation, drone: int) -> Rows:
    """Returns the row of one drone; its columns are `[human, formation.references(drone)...]`."""
    row = formation.row(drone)
    columns = [0, *(1 + formation.row(other) for other in formation.references(drone))]
    return _rows(formation, [row], formation.weights[row][columns][None, :], formation.links_into(drone))


def all_rows(formation: Formation) -> Rows:
    """Returns the rows of all drones; the columns are `[human, drones...]`."""
    return _rows(formation, list(range(len(formation.ids))), formation.weights, formation.links)


def _rows(formation: Formation, rows: list[int], weights: Vec, links: tuple[Link, ...]) -> Rows:
    places = {row: place for place, row in enumerate(rows)}
    return Rows(
        weights=weights,
        offsets=formation.offsets[rows],
        links=links,
        targets=np.array([places[link.target] for link in links], dtype=np.intp),
        limits=np.array([link.limit for link in links]).reshape(-1, 1),
        scale=formation.correction_scale,
    )


def corrections(rows: Rows, links: LinkState) -> tuple[Vec, Vec]:
    """Returns the corrections (..., n, 3), m, and their rates, m/s, in the formation's frame.

    `correction_i = (-|sum dx|, sum dy, sum dz)` over the links into i. Each term is clamped per axis, its
    state is not; a clamped term has no rate.
    """
    term = np.minimum(np.maximum(links.displacement, -rows.limits), rows.limits)
    moving = np.where(term == links.displacement, links.rate, 0.0)
    total, rate = rows.sum_links(term), rows.sum_links(moving)
    rate[..., 0] *= -np.sign(total[..., 0])
    total[..., 0] = -np.abs(total[..., 0])
    return rows.scale * total, rows.scale * rate


def goals(rows: Rows, references: Vec, correction: Vec, yaw: float | Vec) -> Vec:
    """Returns the goals (..., n, 3), world frame, m: `W [p_hand; p_1..p_m] + R(yaw) (offset + correction)`.

    Args:
        rows: The rows to compute.
        references: (..., 1 + m, 3) mapped hand and references: actual positions (`paper`) or goals (`stable`).
        correction: (..., n, 3) formation frame, m.
        yaw: Heading of the formation, rad.
    """
    return rows.weights @ references + rotate(rows.offsets + correction, yaw)


def goal_velocities(rows: Rows, reference_velocities: Vec, place_velocities: Vec) -> Vec:
    """Returns the rates of the goals (..., n, 3), m/s, from the hand's velocity and the link rates.

    Args:
        rows: The rows to compute.
        reference_velocities: (..., 1 + m, 3) mapped hand velocity and the references' goal velocities.
        place_velocities: (..., n, 3) of `place_velocities`.
    """
    return rows.weights @ reference_velocities + place_velocities


def place_velocities(
    rows: Rows, correction: Vec, correction_rate: Vec, yaw: float | Vec, yaw_rate: float | Vec
) -> Vec:
    """Returns how fast `R(yaw) (offset + correction)` changes, (..., n, 3), world frame, m/s.

    Args:
        rows: The rows to compute.
        correction: (..., n, 3) formation frame, m.
        correction_rate: (..., n, 3) formation frame, m/s.
        yaw: Heading of the formation, rad.
        yaw_rate: rad/s.
    """
    place, velocity = rows.offsets + correction, correction_rate.copy()
    velocity[..., 0] -= yaw_rate * place[..., 1]
    velocity[..., 1] += yaw_rate * place[..., 0]
    return rotate(velocity, yaw)


def rotate(vectors: Vec, yaw: float | Vec) -> Vec:
    """Turns vectors (..., 3) about z by `yaw`, a number or (...) headings."""
    if isinstance(yaw, float) and yaw == 0.0:
        return vectors
    c, s = np.cos(yaw), np.sin(yaw)
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)
