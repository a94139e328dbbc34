"""From goals to set-points: tracking, avoidance, limits, lead and fence, for n drones at once.

The reference trajectory follows the goal exactly while nothing is in the way and no limit is hit. The
vehicle's set-point leads it by `tau` times its velocity (`stable` law: `setpoint = goal + tau goal_velocity`).
The paper's law has no lead, except beyond its derated hand speed and while escaping, where it would not get
away in time.
"""

import numpy as np
import numpy.typing as npt
from attrs import evolve, field, frozen

from agents.control import avoidance
from agents.control.avoidance import COLUMN_BUBBLE, DRONE_BUBBLE, HAND_BUBBLE, Encounters
from agents.control.projection import project_swept
from agents.control.trajectory import Trajectory, advance, limit, norm, tracking_velocity
from shared.formation import Vec
from shared.scenario import Avoidance, Limits

Mask = npt.NDArray[np.bool_]

ESCAPE_ACCELERATION = 3.0
"""Factor on the acceleration limit while escaping from a hand or a drone that comes closer."""
ROUNDS = 5
"""How often the escapes from drones, hand and columns are reconciled."""
HAND_SPEED_FACTOR = 1.5
"""The speed limit rises to this times the hand's speed."""
ON_GOAL = 1e-6
"""The reference counts as on the goal within this distance, m."""
SHORTEST_STEP = 1e-4
"""A shorter step counts as this long, s."""
LONGEST_STEP = 0.05
"""A longer pause between two steps does not let the reference move further, s."""


@frozen(kw_only=True)
class SteeringSettings:
    """What steering needs to know of the scenario.

    Attributes:
        limits: Speed and acceleration.
        avoidance: Fields and rule.
        columns: (c, 2) centres, m.
        low: (3,) lowest set-point, m.
        high: (3,) highest set-point, m.
        tau: (n, 1) lag of the vehicles, s.
        always_lead: `stable` law.
        lead_above: Hand speed from which the paper's law leads too, m/s.
    """

    limits: Limits
    avoidance: Avoidance
    columns: Vec = field(eq=False)
    low: Vec = field(eq=False)
    high: Vec = field(eq=False)
    tau: Vec = field(eq=False)
    always_lead: bool
    lead_above: float


@frozen(kw_only=True)
class Surroundings:
    """Who is around, and the bodies that are steered.

    Attributes:
        position: (n, 3) own bodies, m.
        velocity: (n, 3) own bodies, m/s.
        drones: Other drones near each of ours.
        hand: The real hand, once per drone of ours; None before the first sample.
        hand_speed: m/s, a number or (n, 1).
    """

    position: Vec = field(eq=False)
    velocity: Vec = field(eq=False)
    drones: Encounters
    hand: Encounters | None
    hand_speed: float | Vec = field(eq=False)


@frozen(kw_only=True)
class Steered:
    """Result of one step.

    Attributes:
        trajectory: Reference after the step.
        setpoint: (n, 3) m.
        avoiding: (n, 1) something is in the way.
        fenced: (n, 1) the fence is in the way.
    """

    trajectory: Trajectory
    setpoint: Vec = field(eq=False)
    avoiding: Mask = field(eq=False)
    fenced: Mask = field(eq=False)


def steer(
    trajectory: Trajectory,
    goal: Vec,
    goal_velocity: Vec,
    around: Surroundings,
    settings: SteeringSettings,
    dt: float,
) -> Steered:
    """Advances the reference by one step towards the goals.

    Args:
        trajectory: Reference before the step.
        goal: (n, 3) m.
        goal_velocity: (n, 3) m/s.
        around: Bodies, other drones, hand.
        settings: Limits and fields.
        dt: Time since the last step, s.

    Returns:
        The reference and the set-points after the step, inside the fence and the limits.
    """
    limits = settings.limits
    dt = min(max(dt, SHORTEST_STEP), LONGEST_STEP)
    inside = np.minimum(np.maximum(goal, settings.low), settings.high)
    wanted, column_near = _towards(trajectory, inside, settings, dt)
    pushed = _keep_off(wanted, trajectory, around, settings)
    escaping = norm(pushed) > 0.0
    acceleration = np.where(escaping, ESCAPE_ACCELERATION, 1.0) * limits.acceleration
    speed = np.maximum(limits.speed, HAND_SPEED_FACTOR * around.hand_speed)
    moved = advance(trajectory, inside, wanted + pushed, dt, speed, acceleration)
    point = np.minimum(np.maximum(moved.point, settings.low), settings.high)
    avoiding = escaping | column_near
    wish = np.where(_on_goal(moved) & ~avoiding, limit(goal_velocity, speed), moved.velocity)
    share = _lead_share(escaping, around.hand_speed, settings)
    lead = trajectory.lead + limit(share * wish - trajectory.lead, acceleration * dt)
    setpoint = np.minimum(np.maximum(point + settings.tau * lead, settings.low), settings.high)
    return Steered(
        trajectory=evolve(moved, point=point, lead=lead),
        setpoint=setpoint,
        avoiding=avoiding,
        fenced=(inside != goal).any(axis=1, keepdims=True) | (point != moved.point).any(axis=1, keepdims=True),
    )


def _towards(trajectory: Trajectory, goal: Vec, settings: SteeringSettings, dt: float) -> tuple[Vec, Mask]:
    """Returns the wanted velocity (n, 3) with the columns considered, and a mask where one acts."""
    rules = settings.avoidance
    free = tracking_velocity(trajectory, goal, dt, settings.limits.acceleration)
    if not len(settings.columns):
        return free, np.zeros((len(goal), 1), dtype=bool)
    if rules.rule == "projection":
        allowed = goal.copy()
        allowed[:, :2] = project_swept(
            trajectory.point[:, :2],
            goal[:, :2],
            settings.columns,
            rules.projection_radius,
            step=settings.limits.speed * dt,
            margin=rules.projection_margin,
        )
        near = norm(allowed - goal) > 0.0
        return np.where(near, (allowed - trajectory.point) / dt, free), near
    bent, near = avoidance.column_velocity(
        trajectory.point[:, :2], goal[:, :2], settings.columns, rules.columns, rules.xi
    )
    slow = limit(np.column_stack([bent, free[:, 2]]), rules.speed)
    return np.where(near, slow, free), near


def _keep_off(wanted: Vec, trajectory: Trajectory, around: Surroundings, settings: SteeringSettings) -> Vec:
    """Returns the velocity (n, 3) to add to stay away from every drone, from the hand and from the columns.

    Each only adds what the others left missing; further rounds settle between those that disagree. Columns,
    which never give way, have the last word.
    """
    point, moving = trajectory.point[:, :2], trajectory.velocity[:, :2]
    body, flying = around.position[:, :2], around.velocity[:, :2]
    pressing = [avoidance.threats(body, flying, around.drones, DRONE_BUBBLE)]
    push = avoidance.separation(point, around.drones, settings.avoidance.separation)
    if around.hand is not None:
        pressing.append(avoidance.threats(point, moving, around.hand, HAND_BUBBLE))
        pressing.append(avoidance.threats(body, flying, around.hand, HAND_BUBBLE))
        push += avoidance.separation(point, around.hand, settings.avoidance.separation)
    if len(settings.columns):
        columns = avoidance.columns_near(body, flying, settings.columns, COLUMN_BUBBLE)
        pressing.append(avoidance.threats(body, flying, columns, COLUMN_BUBBLE))
    pressing = [each for each in pressing if len(each.row)]
    for _ in range(ROUNDS if pressing else 0):
        before = push.copy()
        for each in pressing:
            push += avoidance.escape(wanted[:, :2] + push, each)
        if (push == before).all():
            break
    planar = np.zeros_like(trajectory.point)
    planar[:, :2] = push
    return planar


def _on_goal(trajectory: Trajectory) -> Mask:
    return norm(trajectory.point - trajectory.goal) < ON_GOAL


def _lead_share(escaping: Mask, hand_speed: float | Vec, settings: SteeringSettings) -> Vec:
    """Returns how much (n, 1) of the lead is used: all under `stable`, what safety needs under `paper`."""
    if settings.always_lead:
        return np.ones(escaping.shape)
    excess = (hand_speed - settings.lead_above) / (0.25 * settings.lead_above)
    return np.where(escaping, 1.0, np.minimum(np.maximum(excess, 0.0), 1.0))
