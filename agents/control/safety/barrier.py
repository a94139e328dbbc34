"""Barriers: how fast a gap may close so that it can still be braked, and what follows for the acceleration.

The largest closing speed is the square-root curve of Wang, Ames and Egerstedt (2017), along which one brakes
evenly, with a straight line near zero instead of the infinite slope there:

    pace(gap) = sqrt(2 brake gap + k^2) - k,  k = brake / rate      and  rate gap  inside, where one is to leave

`h = pace(gap) - closing` must not become negative: the control barrier function's `h' >= -rate h` is linear in
the acceleration that opens the gap.
"""

import math
from typing import Final, final

from mypy_extensions import mypyc_attr


@mypyc_attr(acyclic=True)
@final
class Curve:
    """One barrier's parameters.

    Attributes:
        brake: Deceleration along the curve, m/s^2.
        rate: Slope of the curve at a gap of zero, and how fast the barrier may be approached, 1/s.
        knee: The curve's k, m/s.
    """

    def __init__(self, brake: float, rate: float) -> None:
        self.brake: Final = brake
        self.rate: Final = rate
        self.knee: Final = brake / rate

    def pace(self, gap: float) -> float:
        """Returns how fast a gap may close, m/s; a negative one must open so fast."""
        if gap <= 0.0:
            return self.rate * gap
        return math.sqrt(2.0 * self.brake * gap + self.knee * self.knee) - self.knee

    def demand(self, gap: float, closing: float) -> float:
        """Returns the least acceleration with which a gap must open, m/s^2.

        Args:
            gap: m; negative inside.
            closing: How fast it closes, m/s.
        """
        pace = self.pace(gap)
        slope = self.rate if gap <= 0.0 else self.brake / (pace + self.knee)
        return slope * closing - self.rate * (pace - closing)

    def gap_for(self, closing: float) -> float:
        """Returns the gap in which a closing speed can be braked, m."""
        if closing <= 0.0:
            return closing / self.rate
        return closing * (0.5 * closing / self.brake + 1.0 / self.rate)

    def reach(self, closing: float, acceleration: float) -> float:
        """Returns the gap beyond which nothing is demanded that could be refused, m.

        The curve is nowhere steeper than `rate`, so the demand is at most
        `2 rate closing - rate pace(gap)`: with `pace(gap) >= acceleration / rate + 2 closing` that is no more
        than `-acceleration`.

        Args:
            closing: How fast the gap closes at most, m/s, not negative.
            acceleration: Largest that can be asked for, m/s^2.
        """
        return self.gap_for(acceleration / self.rate + 2.0 * closing)
