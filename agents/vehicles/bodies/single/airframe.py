"""Motion and ground of one body, see `agents.vehicles.bodies.airframe`."""

from agents.vehicles.bodies.airframe import DRAG, GRAVITY, MASS
from shared.messages import ORIGIN, Vector


def move(
    position: Vector, velocity: Vector, along_x: float, along_y: float, thrust: float, dt: float
) -> tuple[Vector, Vector]:
    """Integrates velocity and position over one substep; the ground stops whatever reaches it.

    Args:
        position: World frame, m.
        velocity: World frame, m/s.
        along_x: Mean acceleration over the substep, m/s^2.
        along_y: The same.
        thrust: Its mean, N.
        dt: Substep, s.

    Returns:
        Position and velocity `dt` later.
    """
    (x, y, z), (u, v, w) = position, velocity
    u1, v1 = u + along_x * dt, v + along_y * dt
    w1 = w + (thrust / MASS - GRAVITY - DRAG * w) * dt
    half = 0.5 * dt
    height = z + (w + w1) * half
    if height <= 0.0:
        return (x, y, 0.0), ORIGIN
    return (x + (u + u1) * half, y + (v + v1) * half, height), (u1, v1, w1)
