"""From the goal of one drone to its set-point, see `agents.control.steering`."""

import math
from collections.abc import Sequence

import numpy as np
from attrs import evolve, frozen
from msgspec import Struct

from agents.control.avoidance import COLUMN_BUBBLE, DRONE_BUBBLE, HAND_BUBBLE
from agents.control.projection import project_swept
from agents.control.single import avoidance
from agents.control.single.avoidance import Encounter
from agents.control.single.trajectory import Trajectory, advance, approach, tracking_velocity
from agents.control.single.vectors import Planar, Vector, clamp, shorten
from agents.control.steering import (
    ESCAPE_ACCELERATION,
    HAND_SPEED_FACTOR,
    LONGEST_STEP,
    ON_GOAL,
    ROUNDS,
    SHORTEST_STEP,
)
from shared.scenario import Avoidance, Limits


@frozen(kw_only=True)
class SteeringSettings:
    """What steering needs to know of the scenario.

    Attributes:
        limits: Speed and acceleration.
        avoidance: Fields and rule.
        columns: Centres, m.
        low: Lowest set-point, m.
        high: Highest set-point, m.
        tau: Lag of the vehicle, s.
        always_lead: `stable` law.
        lead_above: Hand speed from which the paper's law leads too, m/s.
    """

    limits: Limits
    avoidance: Avoidance
    columns: tuple[Planar, ...]
    low: Vector
    high: Vector
    tau: float
    always_lead: bool
    lead_above: float


class Bystander(Struct, frozen=True):
    """A body that nobody hears: it may be anywhere near, at any height.

    Attributes:
        x: Where it was last, m.
        y: The same.
        radius: How far to stay away, m.
    """

    x: float
    y: float
    radius: float


class Surroundings(Struct, frozen=True):
    """The body that is steered, and who is around.

    Attributes:
        position: Own body, m.
        velocity: Own body, m/s.
        drones: Every other drone.
        hand: The real hand; None before the first sample.
        hand_speed: m/s.
        silent: Drones that have fallen silent, also among `drones`.
    """

    position: Vector
    velocity: Vector
    drones: Sequence[Encounter]
    hand: Encounter | None
    hand_speed: float
    silent: Sequence[Bystander] = ()


class Steered(Struct, frozen=True):
    """Result of one step.

    Attributes:
        trajectory: Reference after the step.
        setpoint: m.
        avoiding: Something is in the way.
        fenced: The fence is in the way.
    """

    trajectory: Trajectory
    setpoint: Vector
    avoiding: bool
    fenced: bool


def steer(
    trajectory: Trajectory,
    goal: Vector,
    goal_velocity: Vector,
    around: Surroundings,
    settings: SteeringSettings,
    dt: float,
) -> Steered:
    """Advances the reference by one step towards the goal.

    Args:
        trajectory: Reference before the step.
        goal: m.
        goal_velocity: m/s.
        around: Body, other drones, hand.
        settings: Limits and fields.
        dt: Time since the last step, s.

    Returns:
        The reference and the set-point after the step, inside the fence and the limits.
    """
    limits, low, high = settings.limits, settings.low, settings.high
    dt = SHORTEST_STEP if dt < SHORTEST_STEP else LONGEST_STEP if dt > LONGEST_STEP else dt
    inside = clamp(goal, low, high)
    wanted, column_near = _towards(trajectory, inside, settings, dt)
    pu, pv = _keep_off(wanted, trajectory, around, settings)
    escaping = pu * pu + pv * pv > 0.0
    acceleration = limits.acceleration * (ESCAPE_ACCELERATION if escaping else 1.0)
    chasing = HAND_SPEED_FACTOR * around.hand_speed
    speed = chasing if chasing > limits.speed else limits.speed
    u, v, w = wanted
    reached, velocity = advance(trajectory, (u + pu, v + pv, w), dt, speed, acceleration)
    point = clamp(reached, low, high)
    avoiding = escaping or column_near
    on_goal = math.dist(reached, inside) < ON_GOAL
    wish = shorten(goal_velocity, speed) if on_goal and not avoiding else velocity
    share = 1.0 if escaping or settings.always_lead else _lead_share(around.hand_speed, settings.lead_above)
    a, b, c = wish
    lead = approach(trajectory.lead, (share * a, share * b, share * c), acceleration * dt)
    tau, (x, y, z), (a, b, c) = settings.tau, point, lead
    return Steered(
        Trajectory(point, velocity, lead, inside),
        clamp((x + tau * a, y + tau * b, z + tau * c), low, high),
        avoiding,
        inside != goal or point != reached,
    )


def _towards(
    trajectory: Trajectory, goal: Vector, settings: SteeringSettings, dt: float
) -> tuple[Vector, bool]:
    """Returns the wanted velocity with the columns considered, and whether one acts."""
    rules, columns = settings.avoidance, settings.columns
    free = tracking_velocity(trajectory, goal, dt, settings.limits.acceleration)
    if not columns:
        return free, False
    if rules.rule == "projection":
        (x, y, _), (a, b, _) = goal, _projected(trajectory.point, goal, settings, dt)
        if (a - x) ** 2 + (b - y) ** 2 > 0.0:
            x, y, z = trajectory.point
            return ((a - x) / dt, (b - y) / dt, (goal[2] - z) / dt), True
        return free, False
    (u, v), near = avoidance.column_velocity(trajectory.point, goal, columns, rules.columns, rules.xi)
    return (shorten((u, v, free[2]), rules.speed), True) if near else (free, False)


def _projected(point: Vector, goal: Vector, settings: SteeringSettings, dt: float) -> Vector:
    rules = settings.avoidance
    x, y = project_swept(
        np.array(point[:2]),
        np.array(goal[:2]),
        np.array(settings.columns),
        rules.projection_radius,
        step=settings.limits.speed * dt,
        margin=rules.projection_margin,
    ).tolist()
    return (x, y, goal[2])


def _keep_off(
    wanted: Vector, trajectory: Trajectory, around: Surroundings, settings: SteeringSettings
) -> Planar:
    """Returns the velocity to add to stay away from every drone, from the hand and from the columns.

    Each only adds what the others left missing; further rounds settle between those that disagree. Columns,
    which never give way, have the last word.
    """
    point, body, flying = trajectory.point, around.position, around.velocity
    pressing = [avoidance.threats(body, flying, around.drones, DRONE_BUBBLE)]
    for silent in around.silent:
        wider = evolve(DRONE_BUBBLE, radius=silent.radius)
        pressing.append(avoidance.threats(body, flying, [(silent.x, silent.y, 0.0, 0.0)], wider))
    others = around.drones
    if around.hand is not None:
        hand, others = (around.hand,), (*around.drones, around.hand)
        pressing.append(avoidance.threats(point, trajectory.velocity, hand, HAND_BUBBLE))
        pressing.append(avoidance.threats(body, flying, hand, HAND_BUBBLE))
    u, v = avoidance.separation(point, others, settings.avoidance.separation)
    if settings.columns:
        columns = avoidance.columns_near(body, flying, settings.columns, COLUMN_BUBBLE)
        pressing.append(avoidance.threats(body, flying, columns, COLUMN_BUBBLE))
    if not any(pressing):
        return (u, v)
    for _ in range(ROUNDS):
        before = (u, v)
        for each in filter(None, pressing):
            a, b = avoidance.escape((wanted[0] + u, wanted[1] + v), each)
            u, v = u + a, v + b
        if (u, v) == before:
            break
    return (u, v)


def _lead_share(hand_speed: float, lead_above: float) -> float:
    """Returns how much of the lead is used under `paper`: what safety needs."""
    excess = (hand_speed - lead_above) / (0.25 * lead_above)
    return min(max(excess, 0.0), 1.0)
