"""The reference trajectory of one drone, see `agents.control.trajectory`."""

import math

from msgspec import Struct

from agents.control.single.vectors import ORIGIN, Vector, shorten
from agents.control.trajectory import BRAKING_SHARE


class Trajectory(Struct, frozen=True):
    """Reference of one drone.

    Attributes:
        point: m.
        velocity: m/s.
        lead: Velocity that the set-point leads by, m/s.
        goal: Goal of the last step, m.
    """

    point: Vector
    velocity: Vector
    lead: Vector
    goal: Vector


def start_at(point: Vector) -> Trajectory:
    """Returns a trajectory at rest."""
    return Trajectory(point, ORIGIN, ORIGIN, point)


def tracking_velocity(trajectory: Trajectory, goal: Vector, dt: float, acceleration: float) -> Vector:
    """Returns the velocity that reaches the goal at once, or closes in on it without overshoot.

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
    distance = math.hypot(ex, ey, ez)
    if distance == 0.0:
        return ((gx - x) / dt, (gy - y) / dt, (gz - z) / dt)
    at_once, braked = distance / dt, math.sqrt(2.0 * BRAKING_SHARE * acceleration * distance)
    share = (at_once if at_once < braked else braked) / (distance if distance > 1e-12 else 1e-12)
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
    u, v, w = velocity = approach(trajectory.velocity, shorten(wanted, speed), acceleration * dt)
    x, y, z = trajectory.point
    return (x + u * dt, y + v * dt, z + w * dt), velocity


def approach(velocity: Vector, wanted: Vector, largest: float) -> Vector:
    """Changes a velocity towards a wanted one by at most `largest`, m/s."""
    (u, v, w), (a, b, c) = velocity, wanted
    du, dv, dw = a - u, b - v, c - w
    change = math.hypot(du, dv, dw)
    if change > largest:
        share = largest / change
        return (u + du * share, v + dv * share, w + dw * share)
    return (u + du, v + dv, w + dw)
