"""All drones at once as one central computer would fly them: the law of one drone in a loop over all of them.

Every drone is in FOLLOW. Where nobody keeps off anybody the numbers are those of the agents; where somebody
does, a drone here sees the others as they are in this tick, while an agent sees those that step after it one
tick late. Written as `agents.control` is.
"""

import math
from typing import Final, final

from agents.control import modes
from agents.control.avoidance import DRONE_BUBBLE, Encounter
from agents.control.goals import Guide, Row, goal_of
from agents.control.hand import HandInput, MappedHand
from agents.control.impedance import AT_REST, step_links
from agents.control.steering import SteeringSettings, Surroundings, steer
from agents.control.trajectory import start_at
from agents.control.vectors import ORIGIN, norm, rotate
from agents.vehicles.bodies.fleet import Flyer, advance
from agents.vehicles.bodies.state import FLY
from shared.cells import Cells


@final
class Member:
    """One drone of a flock.

    Args:
        row: Its row of the formation.
        references: Places of its references in the flock, in the order of the row's weights.
        steering: Limits and fields.
        flyer: Its body at the start.

    Attributes:
        flyer: Its body now.
        position: Its body as read at the last tick, m.
        goal: Of the last tick, before avoidance, m.
        goal_velocity: m/s.
        setpoint: m.
        links: Its impedance links.
        trajectory: Reference of the set-point.
    """

    __slots__ = (
        "flyer",
        "goal",
        "goal_velocity",
        "links",
        "position",
        "references",
        "row",
        "setpoint",
        "steering",
        "trajectory",
    )

    def __init__(self, row: Row, references: tuple[int, ...], steering: SteeringSettings, flyer: Flyer) -> None:
        self.row: Final = row
        self.references: Final = references
        self.steering: Final = steering
        self.flyer = flyer
        self.position = self.goal = self.setpoint = flyer.body.position
        self.goal_velocity = ORIGIN
        self.links = (AT_REST,) * len(row.links)
        self.trajectory = start_at(self.position)


def advance_flock(
    members: list[Member],
    order: list[int],
    sample: HandInput,
    hand: MappedHand,
    dt: float,
    duration: float,
    *,
    stable: bool,
) -> None:
    """Makes one tick: links, goals in reference order, set-points, bodies.

    Args:
        members: The flock.
        order: Their places, references before those who refer to them.
        sample: The hand.
        hand: The same mapped.
        dt: Time since the last tick, s.
        duration: Time to the next one, s.
        stable: Whether references are the others' goals instead of their positions.
    """
    _set_goals(members, order, hand, dt, stable=stable)
    x, y, _ = sample.position
    u, v, _ = sample.velocity
    own_hand, hand_speed = Encounter(x, y, u, v), norm(sample.velocity)
    encounters = [_encounter(member) for member in members]
    cells = Cells([*encounters], _reach(members, encounters))
    for place, member in enumerate(members):
        near = [encounters[other] for other in cells.near(place)]
        body = member.flyer.body
        around = Surroundings(body.position, body.velocity, near, [], own_hand, hand_speed)
        steered = steer(member.trajectory, member.goal, member.goal_velocity, around, member.steering, dt)
        member.trajectory, member.setpoint = steered.trajectory, steered.setpoint
    for member in members:
        member.flyer = advance(member.flyer, FLY, member.setpoint, duration)


def _set_goals(members: list[Member], order: list[int], hand: MappedHand, dt: float, *, stable: bool) -> None:
    velocity = rotate(hand.velocity, -hand.yaw)
    for place in order:
        member = members[place]
        member.position = member.flyer.body.position
        member.links = step_links(member.links, member.row.links, velocity, dt)
        lead = [_guide(members[other], stable=stable) for other in member.references]
        member.goal, member.goal_velocity = goal_of(member.row, member.links, hand, lead)


def _guide(member: Member, *, stable: bool) -> Guide:
    return Guide(member.goal if stable else member.position, member.goal_velocity, modes.FOLLOW)


def _encounter(member: Member) -> Encounter:
    x, y, _ = member.position
    u, v, _ = member.flyer.body.velocity
    return Encounter(x, y, u, v)


def _reach(members: list[Member], encounters: list[Encounter]) -> float:
    """Returns how far anything can matter, m.

    The field acts on the reference, which is ahead of its body; the bubble grows with the closing speed, at
    most twice the largest difference from the mean velocity.
    """
    mean_u = sum([each.u for each in encounters]) / float(len(encounters))
    mean_v = sum([each.v for each in encounters]) / float(len(encounters))
    ahead = apart = 0.0
    for place, each in enumerate(encounters):
        x, y, _ = members[place].trajectory.point
        ahead = max(ahead, (x - each.x) * (x - each.x) + (y - each.y) * (y - each.y))
        du, dv = each.u - mean_u, each.v - mean_v
        apart = max(apart, du * du + dv * dv)
    field = members[0].steering.separation
    bubble = DRONE_BUBBLE.radius + DRONE_BUBBLE.lead * 2.0 * math.sqrt(apart)
    return max(field.radius + field.d0 + math.sqrt(ahead), bubble)
