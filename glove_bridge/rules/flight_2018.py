"""Rule `flight-2018`, as it ran in the recorded flights: on set-points, sides by what avoidance does to them.

Extended if the area exceeds its default by more than 10 % or the gap across its default by more than 7.5 %,
else contracted if the area falls short by more than 10 %. Left or right is how far avoidance shifts the
centroid of the set-points sideways, as the operator sees it.

The gap across is that between the two drones which rest farthest apart sideways. The default area is that of
the rest shape, but of an equilateral triangle, l^2 sqrt(3)/4, where three drones rest in nearly one: in the
flights they did, 0.7 % flatter.
"""

import math

import numpy as np

from glove_bridge.formation_state import (
    Geometry,
    Memory,
    Reading,
    Scene,
    area_of,
    area_ratio,
    pair_distances,
    right_of,
)
from glove_bridge.rules.thresholds import Thresholds

_EDGE = 1e-6
"""Drones whose rest places differ by less than this across the formation are at the same edge, m."""
_NEARLY = 0.01
"""Relative difference in area up to which a triangle counts as equilateral."""


def read(geometry: Geometry, scene: Scene, memory: Memory, limits: Thresholds) -> tuple[Reading, Memory]:
    """Reads the state of a formation; see `glove_bridge.rules.paper.read`. There is no trend."""
    right = right_of(scene.forward)
    across, along = geometry.rest[:, 1], scene.setpoint @ right
    # Where several drones rest at the same edge their mean counts, so that numbering does not matter.
    rightmost, leftmost = across > across.max() - _EDGE, across < across.min() + _EDGE
    width = float(np.ptp(across))
    gap = float(along[rightmost].mean() - along[leftmost].mean())
    area = area_of(scene.setpoint)
    ratio = area_ratio(area, _default_area(geometry, width))
    displacement = float((scene.setpoint - scene.goal).mean(axis=0) @ right)
    if ratio > limits.extended or (width > 0.0 and gap > limits.across * width):
        extent = 1
    else:
        extent = -1 if ratio < limits.contracted else 0
    reading = Reading(
        area=area,
        area_ratio=ratio,
        distances=geometry.by_pair(pair_distances(scene.setpoint, geometry.pairs)),
        extent=extent,
        trend=0,
        displacement=displacement,
        side=limits.side(displacement),
    )
    return reading, memory


def _default_area(geometry: Geometry, width: float) -> float:
    equilateral = width**2 * math.sqrt(3.0) / 4.0
    alike = len(geometry.ids) == 3 and abs(geometry.area - equilateral) < _NEARLY * equilateral
    return equilateral if alike else geometry.area
