"""From the goal of one drone to its set-point: tracking, avoidance, limits, lead and fence.

The reference trajectory follows the goal exactly while nothing is in the way and no limit is hit. The
vehicle's set-point leads it by `tau` times its velocity (`stable` law: `setpoint = goal + tau goal_velocity`).
The paper's law has no lead, except beyond its derated hand speed and while escaping, where it would not get
away in time.
"""

from typing import Final, final

from agents.control import avoidance
from agents.control.avoidance import COLUMN_BUBBLE, DRONE_BUBBLE, HAND_BUBBLE, Bubble, Encounter, Field, Threat
from agents.control.projection import project_swept
from agents.control.trajectory import Trajectory, advance, approach, tracking_velocity
from agents.control.vectors import Planar, Vector, clamp, distance, shorten

ESCAPE_ACCELERATION: Final = 3.0
"""Factor on the acceleration limit while escaping from a hand or a drone that comes closer."""
ROUNDS: Final = 5
"""How often the escapes from drones, hand and columns are reconciled."""
HAND_SPEED_FACTOR: Final = 1.5
"""The speed limit rises to this times the hand's speed."""
ON_GOAL: Final = 1e-6
"""The reference counts as on the goal within this distance, m."""
SHORTEST_STEP: Final = 1e-4
"""A shorter step counts as this long, s."""
LONGEST_STEP: Final = 0.05
"""A longer pause between two steps does not let the reference move further, s."""


NOTHING: Final[list[list[Threat]]] = []


@final
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

    __slots__ = ("centres", "field", "margin", "projected", "radius", "speed", "xi")

    def __init__(
        self,
        centres: tuple[Planar, ...],
        *,
        projected: bool,
        field: Field,
        xi: float,
        speed: float,
        radius: float,
        margin: float,
    ) -> None:
        self.centres: Final = centres
        self.projected: Final = projected
        self.field: Final = field
        self.xi: Final = xi
        self.speed: Final = speed
        self.radius: Final = radius
        self.margin: Final = margin


@final
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
    """

    __slots__ = (
        "acceleration",
        "always_lead",
        "columns",
        "high",
        "lead_above",
        "low",
        "separation",
        "speed",
        "tau",
    )

    def __init__(
        self,
        *,
        speed: float,
        acceleration: float,
        separation: Field,
        columns: Columns | None,
        low: Vector,
        high: Vector,
        tau: float,
        always_lead: bool,
        lead_above: float,
    ) -> None:
        self.speed: Final = speed
        self.acceleration: Final = acceleration
        self.separation: Final = separation
        self.columns: Final = columns
        self.low: Final = low
        self.high: Final = high
        self.tau: Final = tau
        self.always_lead: Final = always_lead
        self.lead_above: Final = lead_above


@final
class Bystander:
    """A body that nobody hears: it may be anywhere near, at any height.

    Attributes:
        x: Where it was last, m.
        y: The same.
        radius: How far to stay away, m.
    """

    __slots__ = ("radius", "x", "y")

    def __init__(self, x: float, y: float, radius: float) -> None:
        self.x: Final = x
        self.y: Final = y
        self.radius: Final = radius


@final
class Surroundings:
    """The body that is steered, and who is around.

    Attributes:
        position: Own body, m.
        velocity: Own body, m/s.
        drones: Every other drone.
        silent: Those of them that have fallen silent.
        hand: The real hand; nobody before the first sample.
        hand_speed: m/s.
    """

    __slots__ = ("drones", "hand", "hand_speed", "position", "silent", "velocity")

    def __init__(
        self,
        position: Vector,
        velocity: Vector,
        drones: list[Encounter],
        silent: list[Bystander],
        hand: list[Encounter],
        hand_speed: float,
    ) -> None:
        self.position: Final = position
        self.velocity: Final = velocity
        self.drones: Final = drones
        self.silent: Final = silent
        self.hand: Final = hand
        self.hand_speed: Final = hand_speed


@final
class Steered:
    """Result of one step.

    Attributes:
        trajectory: Reference after the step.
        setpoint: m.
        avoiding: Something is in the way.
        fenced: The fence is in the way.
    """

    __slots__ = ("avoiding", "fenced", "setpoint", "trajectory")

    def __init__(self, trajectory: Trajectory, setpoint: Vector, *, avoiding: bool, fenced: bool) -> None:
        self.trajectory: Final = trajectory
        self.setpoint: Final = setpoint
        self.avoiding: Final = avoiding
        self.fenced: Final = fenced


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
    low, high = settings.low, settings.high
    dt = min(max(dt, SHORTEST_STEP), LONGEST_STEP)
    inside = clamp(goal, low, high)
    wanted, column_near = _towards(trajectory, inside, settings, dt)
    u, v, w = wanted
    pu, pv = _keep_off((u, v), trajectory, around, settings)
    escaping = pu * pu + pv * pv > 0.0
    acceleration = settings.acceleration * (ESCAPE_ACCELERATION if escaping else 1.0)
    speed = max(settings.speed, HAND_SPEED_FACTOR * around.hand_speed)
    reached, velocity = advance(trajectory, (u + pu, v + pv, w), dt, speed, acceleration)
    point = clamp(reached, low, high)
    avoiding = escaping or column_near
    on_goal = distance(reached, inside) < ON_GOAL
    a, b, c = shorten(goal_velocity, speed) if on_goal and not avoiding else velocity
    share = 1.0 if escaping or settings.always_lead else _lead_share(around.hand_speed, settings.lead_above)
    lead = approach(trajectory.lead, (share * a, share * b, share * c), acceleration * dt)
    x, y, z = point
    a, b, c = lead
    tau = settings.tau
    return Steered(
        Trajectory(point, velocity, lead, inside),
        clamp((x + tau * a, y + tau * b, z + tau * c), low, high),
        avoiding=avoiding,
        fenced=inside != goal or point != reached,
    )


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


def _keep_off(
    wanted: Planar, trajectory: Trajectory, around: Surroundings, settings: SteeringSettings
) -> Planar:
    """Returns the velocity to add to stay away from every drone, from the hand and from the columns.

    Each only adds what the others left missing; further rounds settle between those that disagree. Columns,
    which never give way, have the last word.
    """
    x, y, _ = trajectory.point
    u, v = avoidance.separation(x, y, around.drones, settings.separation)
    a, b = avoidance.separation(x, y, around.hand, settings.separation)
    u, v = u + a, v + b
    pressing = _pressing(trajectory, around, settings.columns)
    if not pressing:
        return (u, v)
    for _ in range(ROUNDS):
        before_u, before_v = u, v
        for each in pressing:
            a, b = avoidance.escape((wanted[0] + u, wanted[1] + v), each)
            u, v = u + a, v + b
        if u == before_u and v == before_v:
            break
    return (u, v)


def _pressing(trajectory: Trajectory, around: Surroundings, columns: Columns | None) -> list[list[Threat]]:
    """Returns what has to be escaped from, kind by kind; mostly nothing.

    The hand presses the body and the reference alike: the second must not lead the first back.
    """
    x, y, _ = around.position
    u, v, _ = around.velocity
    body, flying, pressing = (x, y), (u, v), NOTHING
    pressing = _with(pressing, avoidance.threats(body, flying, around.drones, DRONE_BUBBLE))
    for silent in around.silent:
        wider = Bubble(silent.radius, DRONE_BUBBLE.lead, DRONE_BUBBLE.slip, DRONE_BUBBLE.response)
        there = [Encounter(silent.x, silent.y, 0.0, 0.0)]
        pressing = _with(pressing, avoidance.threats(body, flying, there, wider))
    x, y, _ = trajectory.point
    u, v, _ = trajectory.velocity
    pressing = _with(pressing, avoidance.threats((x, y), (u, v), around.hand, HAND_BUBBLE))
    pressing = _with(pressing, avoidance.threats(body, flying, around.hand, HAND_BUBBLE))
    if columns is not None:
        near = avoidance.columns_near(body, flying, columns.centres, COLUMN_BUBBLE)
        pressing = _with(pressing, avoidance.threats(body, flying, near, COLUMN_BUBBLE))
    return pressing


def _with(pressing: list[list[Threat]], found: list[Threat]) -> list[list[Threat]]:
    return [*pressing, found] if found else pressing


def _lead_share(hand_speed: float, lead_above: float) -> float:
    """Returns how much of the lead is used under `paper`: what safety needs."""
    excess = (hand_speed - lead_above) / (0.25 * lead_above)
    return min(max(excess, 0.0), 1.0)
