"""The box that no drone leaves."""

import numpy as np

from shared.formation import Formation, Vec
from shared.scenario import Scenario

_CEILING = 2.0
"""Height of an automatic fence above the take-off height, m."""


def fence_box(scenario: Scenario, formation: Formation) -> tuple[Vec, Vec]:
    """Returns the lower and upper corner (3,) of the fence in the world frame, m.

    A corner that the scenario does not give lies `fence.room` around the rest formation at home; the floor is
    at z = -0.1 (a landed drone is inside).
    """
    fence = scenario.fence
    home = np.array([*scenario.hand.home, 0.0])
    shape = np.vstack([formation.rest, np.zeros(3)]) + home
    low = shape.min(axis=0) - fence.room
    high = shape.max(axis=0) + fence.room
    low[2], high[2] = -0.1, scenario.limits.takeoff_height + _CEILING
    return (
        np.array(fence.min) if fence.min is not None else low,
        np.array(fence.max) if fence.max is not None else high,
    )
