"""Motors, motion and ground, shared by all bodies: the Crazyflie 2.0 of Foerster (2015), reduced.

The reduced model is a point mass whose thrust acts along z, whatever the tilt; it stays within 16 mm of the
six-degree-of-freedom one for steps up to 1 m (DESIGN section 7b).
"""

from typing import Final

GRAVITY: Final = 9.81
MASS: Final = 0.028
"""kg (Foerster 2015)."""

HOVER_PWM: Final = 37_287.0
"""Motor command whose thrust carries the weight."""

MOTOR_LAG: Final = 0.065
"""Time constant of the thrust, s."""

DRAG: Final = 0.05
"""Effective linear drag, 1/s: brings the x step's overshoot from 18.7 % to the 17 % of the full model."""

Motion = tuple[float, float, float, float, float, float]
"""Position x, y, z, m, and velocity u, v, w, m/s, in the world frame."""


def thrust_of(pwm: float) -> float:
    """Returns the static thrust of the four rotors, N (Foerster 2015); `pwm` 0..65535, 0 is motors off."""
    if pwm <= 0.0:
        return 0.0
    return 4.0 * ((2.130295e-11 * pwm + 1.032633e-6) * pwm + 5.484560e-4)


def move(motion: Motion, along_x: float, along_y: float, thrust: float, dt: float) -> Motion:
    """Integrates velocity and position over one substep; the ground stops whatever reaches it.

    Args:
        motion: Before.
        along_x: Mean acceleration over the substep, m/s^2.
        along_y: The same.
        thrust: Its mean, N.
        dt: Substep, s.

    Returns:
        `dt` later. What is on the ground stays where it stands until its thrust exceeds its weight.
    """
    x, y, z, u, v, w = motion
    u1, v1 = u + along_x * dt, v + along_y * dt
    w1 = w + (thrust / MASS - GRAVITY - DRAG * w) * dt
    half = 0.5 * dt
    height = z + (w + w1) * half
    if height <= 0.0:
        return (x, y, 0.0, 0.0, 0.0, 0.0)
    return (x + (u + u1) * half, y + (v + v1) * half, height, u1, v1, w1)
