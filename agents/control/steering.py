"""From the goal of one drone to its set-point: tracking, avoidance, limits, lead and fence.

The reference trajectory follows the goal exactly while nothing is in the way and no limit is hit. The
vehicle's set-point leads it by `tau` times its velocity (`stable` law: `setpoint = goal + tau goal_velocity`).
The paper's law has no lead, except beyond its derated hand speed.

All that is the mission. What the vehicle is told is up to the safety filter; where that does something else,
the reference goes on from there.
"""

from dataclasses import dataclass
from typing import Final, final

from mypy_extensions import mypyc_attr

from agents.control import avoidance
from agents.control.avoidance import Field
from agents.control.projection import project_swept
from agents.control.safety.demands import SafetySettings
from agents.control.safety.encounter import Encounter
from agents.control.safety.filter import Guarded, Wish, guard
from agents.control.safety.motion import Motion
from agents.control.trajectory import Trajectory, advance, approach, tracking_velocity
from agents.control.vectors import Planar, Vector, clamp, distance, shorten

HAND_SPEED_FACTOR: Final = 1.5
"""The speed limit rises to this times the hand's speed."""
ON_GOAL: Final = 1e-6
"""The reference counts as on the goal within this distance, m."""
SHORTEST_STEP: Final = 1e-4
"""A shorter step counts as this long, s."""
LONGEST_STEP: Final = 0.05
"""A longer pause between two steps does not let the reference move further, s."""


@final
@dataclass(frozen=True, kw_only=True)
class Columns:
    """The columns, and by which rule they are avoided.

    Attributes:
        centres: m.
        projected: By projection, else by their field.
        field: Of each.
        xi: Gain of the attraction, 1/s.
        speed: Largest set-point speed while the field acts, m/s.
        radius: Circle of the projection, m.
        margin: Added to it, m.
    """

    centres: tuple[Planar, ...]
    projected: bool
    field: Field
    xi: float
    speed: float
    radius: float
    margin: float


@final
@dataclass(frozen=True, kw_only=True)
class SteeringSettings:
    """What steering needs to know of the scenario.

    Attributes:
        speed: Limit, m/s.
        acceleration: Limit, m/s^2.
        separation: Field of other drones and of the hand.
        columns: None if there are none.
        low: Lowest set-point, m.
        high: Highest set-point, m.
        tau: Lag of the vehicle, s.
        always_lead: `stable` law.
        lead_above: Hand speed from which the paper's law leads too, m/s.
        safety: Of the filter.
    """

    speed: float
    acceleration: float
    separation: Field
    columns: Columns | None
    low: Vector
    high: Vector
    tau: float
    always_lead: bool
    lead_above: float
    safety: SafetySettings


@mypyc_attr(acyclic=True, free_list_len=1)
@final
class Surroundings:
    """What there is to keep away from, beside columns and fence.

    Attributes:
        drones: Every other drone.
        walkers: The real hand, and who else does not look.
        hand_speed: m/s.
    """

    def __init__(self, drones: list[Encounter], walkers: list[Encounter], hand_speed: float) -> None:
        self.drones: Final = drones
        self.walkers: Final = walkers
        self.hand_speed: Final = hand_speed


@mypyc_attr(acyclic=True, free_list_len=1)
@final
class Steered:
    """Result of one step.

    Attributes:
        trajectory: Reference after the step.
        guarded: What the safety filter made of it; its set-point is for the vehicle.
        avoiding: Something is in the way.
        fenced: The fence is in the way.
    """

    def __init__(self, trajectory: Trajectory, guarded: Guarded, *, avoiding: bool, fenced: bool) -> None:
        self.trajectory: Final = trajectory
        self.guarded: Final = guarded
        self.avoiding: Final = avoiding
        self.fenced: Final = fenced


def steer(
    trajectory: Trajectory,
    motion: Motion,
    goal: Vector,
    goal_velocity: Vector,
    around: Surroundings,
    settings: SteeringSettings,
    dt: float,
    *,
    floor: bool,
) -> Steered:
    """Advances the reference by one step towards the goal.

    Args:
        trajectory: Reference before the step.
        motion: The own body.
        goal: m.
        goal_velocity: m/s.
        around: Other drones, hand, obstacles.
        settings: Limits, fields and the filter's.
        dt: Time since the last step, s.
        floor: Whether the fence has one: not while taking off or landing.

    Returns:
        The reference and the set-point after the step, inside the fence and the limits.
    """
    low, high = settings.low, settings.high
    dt = min(max(dt, SHORTEST_STEP), LONGEST_STEP)
    inside = clamp(goal, low, high)
    wanted, column_near = _towards(trajectory, inside, settings, dt)
    u, v, w = wanted
    pu, pv = _keep_off(trajectory, around, settings)
    avoiding = column_near or pu * pu + pv * pv > 0.0
    speed = max(settings.speed, HAND_SPEED_FACTOR * around.hand_speed)
    wanted = shorten((u + pu, v + pv, w), speed)
    reached, velocity = advance(trajectory, wanted, dt, speed, settings.acceleration)
    point = clamp(reached, low, high)
    on_goal = distance(reached, inside) < ON_GOAL
    a, b, c = shorten(goal_velocity, speed) if on_goal and not avoiding else velocity
    share = 1.0 if settings.always_lead else _lead_share(around.hand_speed, settings.lead_above)
    lead = approach(trajectory.lead, (share * a, share * b, share * c), settings.acceleration * dt)
    x, y, z = point
    a, b, c = lead
    tau = settings.tau
    setpoint = clamp((x + tau * a, y + tau * b, z + tau * c), low, high)
    wish = Wish(setpoint, wanted, settings.acceleration)
    guarded = guard(wish, motion, around.walkers, around.drones, settings.safety, dt, floor=floor)
    return Steered(
        _taken_up(Trajectory(point, velocity, lead, inside), guarded, speed, share, tau),
        guarded,
        avoiding=avoiding or guarded.planar or guarded.upright,
        fenced=inside != goal or point != reached,
    )


def _taken_up(trajectory: Trajectory, guarded: Guarded, speed: float, share: float, tau: float) -> Trajectory:
    """Returns a reference that goes on from what the filter did, as if the mission had wanted that."""
    if not (guarded.planar or guarded.upright):
        return trajectory
    pace = shorten(guarded.pace, speed)
    x, y, z = trajectory.point
    u, v, w = trajectory.velocity
    a, b, c = trajectory.lead
    if guarded.planar:
        u, v = pace[0], pace[1]
        a, b = share * u, share * v
        x, y = guarded.setpoint[0] - tau * a, guarded.setpoint[1] - tau * b
    if guarded.upright:
        w = pace[2]
        c = share * w
        z = guarded.setpoint[2] - tau * c
    return Trajectory((x, y, z), (u, v, w), (a, b, c), trajectory.goal)


def _towards(
    trajectory: Trajectory, goal: Vector, settings: SteeringSettings, dt: float
) -> tuple[Vector, bool]:
    """Returns the wanted velocity with the columns considered, and whether one acts."""
    free = tracking_velocity(trajectory, goal, dt, settings.acceleration)
    columns = settings.columns
    if columns is None:
        return free, False
    x, y, z = trajectory.point
    gx, gy, gz = goal
    if columns.projected:
        longest = settings.speed * dt
        a, b = project_swept((x, y), (gx, gy), columns.centres, columns.radius, longest, columns.margin)
        if a == gx and b == gy:
            return free, False
        return ((a - x) / dt, (b - y) / dt, (gz - z) / dt), True
    bent, near = avoidance.column_velocity((x, y), (gx, gy), columns.centres, columns.field, columns.xi)
    return (shorten((bent[0], bent[1], free[2]), columns.speed), True) if near else (free, False)


def _keep_off(trajectory: Trajectory, around: Surroundings, settings: SteeringSettings) -> Planar:
    """Returns the repulsion of every other drone and of who walks among them, m/s."""
    x, y = trajectory.point[0], trajectory.point[1]
    u, v = avoidance.separation(x, y, around.drones, settings.separation)
    a, b = avoidance.separation(x, y, around.walkers, settings.separation)
    return (u + a, v + b)


def _lead_share(hand_speed: float, lead_above: float) -> float:
    """Returns how much of the lead is used under `paper`: what safety needs."""
    excess = (hand_speed - lead_above) / (0.25 * lead_above)
    return min(max(excess, 0.0), 1.0)
