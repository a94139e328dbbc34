"""Impedance links into one drone, see `agents.control.impedance` for their equation."""

from collections.abc import Sequence

from msgspec import Struct

from agents.control.impedance import discretise
from agents.control.single.vectors import ORIGIN, Vector
from shared.formation import Link


class LinkState(Struct, frozen=True):
    """Displacement, m, and rate, m/s, of one link in the formation's frame."""

    displacement: Vector
    rate: Vector


AT_REST = LinkState(ORIGIN, ORIGIN)


def step_links(
    states: Sequence[LinkState], links: Sequence[Link], hand_velocity: Vector, dt: float
) -> tuple[LinkState, ...]:
    """Advances the links by one step.

    Args:
        states: Before, one per link.
        links: Their parameters.
        hand_velocity: Mapped hand velocity in the formation's frame, m/s, held over the step.
        dt: Step, s, > 0.
    """
    hx, hy, hz = hand_velocity
    stepped = []
    for i, link in enumerate(links):
        a00, a01, a10, a11, b0, b1 = discretise(link.mass, link.damping, link.stiffness, link.gain, dt)
        (x, y, z), (u, v, w) = states[i].displacement, states[i].rate
        displacement = (a00 * x + a01 * u + b0 * hx, a00 * y + a01 * v + b0 * hy, a00 * z + a01 * w + b0 * hz)
        rate = (a10 * x + a11 * u + b1 * hx, a10 * y + a11 * v + b1 * hy, a10 * z + a11 * w + b1 * hz)
        stepped.append(LinkState(displacement, rate))
    return tuple(stepped)
