"""From when on a state of the formation is told: parameters of the rules."""

from attrs import field, frozen
from attrs.validators import ge, gt, le


@frozen(kw_only=True)
class Thresholds:
    """`[thresholds]` of a pattern set; the defaults are the paper's, or ours where it gives none.

    Attributes:
        extended: Ratio to the default above which the formation is extended.
        contracted: Ratio to the default below which it is contracted.
        across: `flight-2018`: the same as `extended` for the gap across.
        side_m: Shift of the centroid from which on it has a side, m.
        trend_on: Relative rate of the mean neighbour distance at which a trend begins, 1/s.
        trend_off: At which it ends, 1/s.
        moving_mps: Speed of the centroid from which on it has a direction, m/s.
    """

    extended: float = field(default=1.10, validator=ge(1.0))
    contracted: float = field(default=0.90, validator=[gt(0.0), le(1.0)])
    across: float = field(default=1.075, validator=ge(1.0))
    side_m: float = field(default=0.05, validator=ge(0.0))
    trend_on: float = field(default=0.10, validator=gt(0.0))
    trend_off: float = field(default=0.03, validator=ge(0.0))
    moving_mps: float = field(default=0.10, validator=gt(0.0))

    def __attrs_post_init__(self) -> None:
        if self.trend_off > self.trend_on:
            raise ValueError(f"trend_off {self.trend_off} must not exceed trend_on {self.trend_on}")

    def side(self, displacement: float) -> int:
        """Returns -1 for a shift to the left, +1 to the right, 0 for none worth telling."""
        if abs(displacement) <= self.side_m:
            return 0
        return 1 if displacement > 0.0 else -1
