"""The reference trajectory: follows the goal exactly while it may, within speed and acceleration limits.

The vehicle's set-point leads it: `setpoint = reference + tau * lead velocity`. The limits bound the reference
and the lead velocity, so the vehicle is never asked for more acceleration than the limit.
"""

import math
from typing import Final, final

from mypy_extensions import mypyc_attr

from agents.control.vectors import ORIGIN, Vector, norm, shorten

BRAKING_SHARE: Final = 0.8
"""Share of the acceleration limit used to plan braking; the rest is for following a moving goal."""


@mypyc_attr(acyclic=True)
@final
class Trajectory:
    """Reference of one drone.

    Attributes:
        point: m.
        velocity: m/s.
        lead: Velocity that the set-point leads by, m/s.
        goal: Goal of the last step, m.
    """

    def __init__(self, point: Vector, velocity: Vector, lead: Vector, goal: Vector) -> None:
        self.point: Final = point
        self.velocity: Final = velocity
        self.lead: Final = lead
        self.goal: Final = goal


def start_at(point: Vector) -> Trajectory:
    """Returns a trajectory at rest."""
    return Trajectory(point, ORIGIN, ORIGIN, point)


def tracking_velocity(trajectory: Trajectory, goal: Vector, dt: float, acceleration: float) -> Vector:
    """Returns the velocity that reaches the goal at once, or closes in on it without overshoot.

    In the frame of the moving goal the distance is closed at most as fast as it can be braked away; what
    the finite step adds is 0.6 acceleration dt^2, half a millimetre at 60 Hz.

    Args:
        trajectory: Reference before the step.
        goal: Goal of this step, m.
        dt: Step, s.
        acceleration: Limit, m/s^2.
    """
    px, py, pz = trajectory.point
    x, y, z = trajectory.goal
    gx, gy, gz = goal
    ex, ey, ez = x - px, y - py, z - pz
    way = norm((ex, ey, ez))
    if way == 0.0:
        return ((gx - x) / dt, (gy - y) / dt, (gz - z) / dt)
    closing = min(way / dt, math.sqrt(2.0 * BRAKING_SHARE * acceleration * way))
    share = closing / max(way, 1e-12)
    return ((gx - x) / dt + ex * share, (gy - y) / dt + ey * share, (gz - z) / dt + ez * share)


def advance(
    trajectory: Trajectory, wanted: Vector, dt: float, speed: float, acceleration: float
) -> tuple[Vector, Vector]:
    """Moves the reference with the wanted velocity as far as the limits allow.

    Args:
        trajectory: Reference before the step.
        wanted: Wanted velocity, m/s.
        dt: Step, s.
        speed: Limit, m/s.
        acceleration: Limit, m/s^2.

    Returns:
        Its point and velocity after the step.
    """
    velocity = approach(trajectory.velocity, shorten(wanted, speed), acceleration * dt)
    x, y, z = trajectory.point
    u, v, w = velocity
    return (x + u * dt, y + v * dt, z + w * dt), velocity


def approach(velocity: Vector, wanted: Vector, largest: float) -> Vector:
    """Changes a velocity towards a wanted one by at most `largest`, m/s."""
    u, v, w = velocity
    a, b, c = wanted
    du, dv, dw = shorten((a - u, b - v, c - w), largest)
    return (u + du, v + dv, w + dw)
