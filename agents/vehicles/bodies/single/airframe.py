"""Motion and ground of one body, see `agents.vehicles.bodies.airframe`."""

from agents.vehicles.bodies.airframe import DRAG, GRAVITY, MASS

Motion = tuple[float, float, float, float, float, float]
"""Position x, y, z, m, and velocity u, v, w, m/s, in the world frame."""


def move(
    x: float,
    y: float,
    z: float,
    u: float,
    v: float,
    w: float,
    along_x: float,
    along_y: float,
    thrust: float,
    dt: float,
) -> Motion:
    """Integrates velocity and position over one substep; the ground stops whatever reaches it.

    Args:
        x: Position, m.
        y: The same.
        z: The same.
        u: Velocity along x, m/s.
        v: Along y.
        w: Along z.
        along_x: Mean acceleration over the substep, m/s^2.
        along_y: The same.
        thrust: Its mean, N.
        dt: Substep, s.

    Returns:
        Position and velocity `dt` later.
    """
    u1, v1 = u + along_x * dt, v + along_y * dt
    w1 = w + (thrust / MASS - GRAVITY - DRAG * w) * dt
    half = 0.5 * dt
    height = z + (w + w1) * half
    if height <= 0.0:
        return x, y, 0.0, 0.0, 0.0, 0.0
    return x + (u + u1) * half, y + (v + v1) * half, height, u1, v1, w1
