"""The bodies of a fleet one by one, see `agents.vehicles.bodies.fleet`."""

from msgspec import Struct
from msgspec.structs import replace

from agents.vehicles.base import Pose
from agents.vehicles.bodies.advance import BODIES, ONE_BY_ONE, advance_one
from agents.vehicles.bodies.fleet import Fleet
from agents.vehicles.bodies.single.state import Body, Fly, apart
from agents.vehicles.bodies.state import AIRBORNE_HEIGHT
from shared.messages import ORIGIN, Vector


class Flyer(Struct, frozen=True):
    """One body of a fleet, its type, and whether a hand holds it in place."""

    body: Body
    fly: Fly
    held: bool


def flyers(fleet: Fleet) -> list[Flyer]:
    """Returns the bodies of a fleet in the order of its rows."""
    found = {
        row: Flyer(body, ONE_BY_ONE[BODIES[group.body]], fleet.ids[row] in fleet.held)
        for group in fleet.groups
        for row, body in zip(group.rows.tolist(), apart(group.state), strict=True)
    }
    return [found[row] for row in sorted(found)]


def advance_flyer(flyer: Flyer, kind: int, setpoint: Vector, duration: float) -> Flyer:
    """Advances one body with its command held.

    Args:
        flyer: Before.
        kind: Value of a `Command`.
        setpoint: m.
        duration: s, >= 0.
    """
    body = advance_one(flyer.fly, flyer.body, kind, setpoint, duration)
    if flyer.held:
        body = replace(body, position=flyer.body.position, velocity=ORIGIN)
    return Flyer(body, flyer.fly, flyer.held)


def pose_of(flyer: Flyer, charge: float, seq: int) -> Pose:
    """Returns what its vehicle reports.

    Args:
        flyer: The body now.
        charge: Of its battery, 0..1.
        seq: Number of this report.
    """
    position = flyer.body.position
    return Pose(position, flyer.body.velocity, 0.0, charge, position[2] > AIRBORNE_HEIGHT, seq)
