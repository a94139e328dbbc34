"""The reference trajectory: follows the goal exactly while it may, within speed and acceleration limits.

The vehicle's set-point leads it: `setpoint = reference + tau * lead velocity`. The limits bound the reference
and the lead velocity, so the vehicle is never asked for more acceleration than the limit.
"""

import numpy as np
from attrs import field, frozen

from shared.formation import Vec

BRAKING_SHARE = 0.8
"""Share of the acceleration limit used to plan braking; the rest is for following a moving goal."""


@frozen(kw_only=True)
class Trajectory:
    """Reference of n drones.

    Attributes:
        point: (n, 3) m.
        velocity: (n, 3) m/s.
        lead: (n, 3) velocity that the set-point leads by, m/s.
        goal: (n, 3) goal of the last step, m.
    """

    point: Vec = field(eq=False)
    velocity: Vec = field(eq=False)
    lead: Vec = field(eq=False)
    goal: Vec = field(eq=False)


def start_at(points: Vec) -> Trajectory:
    """Returns a trajectory at rest at points (n, 3)."""
    zero = np.zeros_like(points)
    return Trajectory(point=points, velocity=zero, lead=zero, goal=points)


def tracking_velocity(trajectory: Trajectory, goal: Vec, dt: float, acceleration: float) -> Vec:
    """Returns the velocity (n, 3) that reaches the goal at once, or closes in on it without overshoot.

    In the frame of the moving goal the distance is closed at most as fast as it can be braked away; what
    the finite step adds is 0.6 acceleration dt^2, half a millimetre at 60 Hz.

    Args:
        trajectory: Reference before the step.
        goal: (n, 3) goal of this step, m.
        dt: Step, s.
        acceleration: Limit, m/s^2.
    """
    goal_velocity = (goal - trajectory.goal) / dt
    error = trajectory.goal - trajectory.point
    distance = norm(error)
    closing = np.minimum(distance / dt, np.sqrt(2.0 * BRAKING_SHARE * acceleration * distance))
    return goal_velocity + error * (closing / np.maximum(distance, 1e-12))


def advance(
    trajectory: Trajectory, goal: Vec, wanted: Vec, dt: float, speed: float | Vec, acceleration: float | Vec
) -> Trajectory:
    """Moves the reference with the wanted velocity as far as the limits allow.

    Args:
        trajectory: Reference before the step.
        goal: (n, 3) goal of this step, m.
        wanted: (n, 3) wanted velocity, m/s.
        dt: Step, s.
        speed: Limit, m/s.
        acceleration: Limit, m/s^2.
    """
    change = limit(limit(wanted, speed) - trajectory.velocity, acceleration * dt)
    velocity = trajectory.velocity + change
    return Trajectory(
        point=trajectory.point + velocity * dt, velocity=velocity, lead=trajectory.lead, goal=goal
    )


def limit(vectors: Vec, largest: float | Vec) -> Vec:
    """Shortens vectors (n, 3) to at most `largest`."""
    length = norm(vectors)
    return vectors * np.minimum(1.0, largest / np.maximum(length, 1e-12))


def norm(vectors: Vec) -> Vec:
    """Returns the lengths (n, 1) of vectors (n, 3)."""
    lengths: Vec = np.sqrt(np.vecdot(vectors, vectors))
    return lengths[:, None]
