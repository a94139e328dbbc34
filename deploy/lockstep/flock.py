"""All drones at once as one central computer would fly them: the law of one drone in a loop over all of them.

Every drone is in FOLLOW. Where nobody keeps off anybody the numbers are those of the agents; where somebody
does, a drone here sees the others as they are in this tick, while an agent sees those that step after it one
tick late. Written as `agents.control` is.
"""

import math
from typing import Final, final

from agents.control import modes
from agents.control.goals import Guide, Row, goal_of
from agents.control.hand import HandInput, MappedHand
from agents.control.impedance import AT_REST, step_links
from agents.control.safety.encounter import Clearance, Encounter, drone_heard, walker_seen
from agents.control.safety.motion import point_ahead, start_motion, watch
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
        references: Its references, in the order of the row's weights.
        steering: Limits, fields and the filter's.
        clearance: How far the others keep from it.
        flyer: Its body at the start.

    Attributes:
        flyer: Its body now.
        position: Its body as read at the last tick, m.
        goal: Of the last tick, before avoidance, m.
        goal_velocity: m/s.
        setpoint: m.
        links: Its impedance links.
        trajectory: Reference of the set-point.
        motion: What is known about its body.
        asked: Acceleration that its vehicle is asked for, m/s^2.
        guide: What those follow who refer to it.
        encounter: What those see who keep off it.
    """

    def __init__(
        self,
        row: Row,
        references: "tuple[Member, ...]",
        steering: SteeringSettings,
        clearance: Clearance,
        flyer: Flyer,
    ) -> None:
        self.row: Final = row
        self.references: Final = references
        self.steering: Final = steering
        self.clearance: Final = clearance
        self.flyer = flyer
        self.position = self.goal = self.setpoint = flyer.body.position
        self.goal_velocity = ORIGIN
        self.links = (AT_REST,) * len(row.links)
        self.trajectory = start_at(self.position)
        self.guide = Guide(self.goal, ORIGIN, modes.FOLLOW)
        self.motion = start_motion(self.position, flyer.body.velocity, 0.0)
        self.asked = ORIGIN
        self.encounter = self.met()

    def met(self) -> Encounter:
        """Returns what those see who keep off it."""
        safety = self.steering.safety
        ahead, pace = point_ahead(self.motion, safety.horizontal, safety.vertical)
        return drone_heard(ahead, pace, self.asked, 0.0, self.clearance, yields=True)


def advance_flock(
    flock: list[Member], sample: HandInput, hand: MappedHand, dt: float, duration: float, *, stable: bool
) -> None:
    """Makes one tick: links, goals, set-points, bodies.

    Args:
        flock: Who flies, references before those who refer to them.
        sample: The hand.
        hand: The same mapped.
        dt: Time since the last tick, s.
        duration: Time to the next one, s.
        stable: Whether references are the others' goals instead of their positions.
    """
    ahead = _set_goals(flock, hand, dt, stable=stable)
    hand_speed = norm(sample.velocity)
    cells = Cells([member.encounter for member in flock], _reach(flock, ahead))
    known, own_hand = flock[0].steering, [_hand_met(sample, flock[0].steering)]
    for member in flock:
        rules, goal, rate = member.steering, member.goal, member.goal_velocity
        if rules is not known:  # drones with equal vehicles share theirs
            known, own_hand = rules, [_hand_met(sample, rules)]
        around = Surroundings(cells.near(member.encounter), own_hand, hand_speed)
        steered = steer(member.trajectory, member.motion, goal, rate, around, rules, dt, floor=True)
        member.trajectory, guarded = steered.trajectory, steered.guarded
        member.motion, member.asked, member.setpoint = guarded.motion, guarded.asked, guarded.setpoint
        # Nobody looks at the body itself any more in this tick.
        member.flyer = advance(member.flyer, FLY, member.setpoint, duration)


def _hand_met(sample: HandInput, rules: SteeringSettings) -> Encounter:
    return walker_seen(sample.position, sample.velocity, 0.0, rules.safety.horizontal.lag, rules.safety.hand)


def _set_goals(flock: list[Member], hand: MappedHand, dt: float, *, stable: bool) -> float:
    """Sets everybody's goal; returns how far a reference is ahead of its body at most, seen from above, m."""
    velocity, ahead = rotate(hand.velocity, -hand.yaw), 0.0
    for member in flock:
        member.position = member.flyer.body.position
        flying = member.flyer.body.velocity
        safety = member.steering.safety
        across, up = safety.horizontal, safety.vertical
        member.motion = watch(member.motion, member.position, flying, 0.0, dt, across, up)
        member.encounter = each = member.met()
        x, y = member.trajectory.point[0], member.trajectory.point[1]
        ahead = max(ahead, (x - each.x) * (x - each.x) + (y - each.y) * (y - each.y))
        member.links = step_links(member.links, member.row.links, velocity, dt)
        lead = [reference.guide for reference in member.references]
        goal, rate = goal_of(member.row, member.links, hand, lead)
        member.goal, member.goal_velocity = goal, rate
        member.guide = Guide(goal if stable else member.position, rate, modes.FOLLOW)
    return math.sqrt(ahead)


def _reach(flock: list[Member], ahead: float) -> float:
    """Returns how far anything can matter, m.

    The field acts on the reference, which is ahead of its body; a barrier's reach grows with the closing speed,
    at most twice the largest difference from the mean velocity.
    """
    mean_u = mean_v = apart = 0.0
    for member in flock:
        mean_u, mean_v = mean_u + member.encounter.u, mean_v + member.encounter.v
    mean_u, mean_v = mean_u / float(len(flock)), mean_v / float(len(flock))
    for member in flock:
        each = member.encounter
        du, dv = each.u - mean_u, each.v - mean_v
        apart = max(apart, du * du + dv * dv)
    reach, closing = 0.0, 2.0 * math.sqrt(apart)
    rules: SteeringSettings | None = None
    clearance: Clearance | None = None
    for member in flock:
        if member.steering is rules and member.clearance is clearance:  # drones with equal vehicles share both
            continue
        rules, clearance = member.steering, member.clearance
        safety, field = rules.safety, rules.separation
        brake = safety.planar.reach(closing + member.encounter.surprise, safety.horizontal.acceleration)
        reach = max(reach, field.radius + field.d0 + ahead)
        reach = max(reach, clearance.distance + brake)
    return reach
