"""What stands or walks upright: vertical cylinders, and how far a point is from one. Pure."""

import math
from typing import NamedTuple

from shared.messages import ObstacleState, Vector
from shared.scenario import Scenario


class Cylinder(NamedTuple):
    """A vertical cylinder.

    Attributes:
        x: Its axis, m.
        y: The same.
        radius: m.
        low: Height of its lower end, m.
        high: Height of its upper end, m.
    """

    x: float
    y: float
    radius: float
    low: float = -math.inf
    high: float = math.inf

    def gap(self, point: Vector) -> float:
        """Returns how far a point is from the surface, m; negative inside."""
        x, y, z = point
        aside = math.hypot(x - self.x, y - self.y) - self.radius
        beyond = max(self.low - z, z - self.high)
        if beyond <= 0.0:
            return aside
        return math.hypot(max(aside, 0.0), beyond)


def columns_of(scenario: Scenario) -> tuple[Cylinder, ...]:
    """Returns the columns of a scenario, in its order."""
    common = scenario.avoidance.columns.radius
    return tuple(
        Cylinder(
            column.x,
            column.y,
            common if column.radius is None else column.radius,
            high=math.inf if column.height is None else column.height,
        )
        for column in scenario.obstacles
    )


def cylinder_of(obstacle: ObstacleState) -> Cylinder:
    """Returns a moving obstacle as it was when it was said to be there."""
    x, y, z = obstacle.position
    return Cylinder(x, y, obstacle.radius, z, z + obstacle.height)
