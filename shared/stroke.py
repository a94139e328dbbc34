"""Minimum-jerk motion, the profile of human reaching (Flash and Hogan 1985). Pure."""

MINIMUM_JERK_PEAK = 1.875
"""Peak over mean speed of the profile."""


def minimum_jerk(fraction: float) -> float:
    """Returns the travelled fraction of a stroke at a fraction in [0, 1] of its time."""
    return fraction**3 * (10.0 - 15.0 * fraction + 6.0 * fraction**2)


def minimum_jerk_rate(fraction: float) -> float:
    """Returns the derivative of `minimum_jerk`: speed over mean speed."""
    return 30.0 * fraction**2 * (1.0 - fraction) ** 2
