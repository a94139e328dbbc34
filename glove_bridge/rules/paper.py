"""Rule `paper` (section 5.2), on where the drones are: any formation, any number.

Extended if the area or any neighbour distance exceeds its default by more than 10 %, contracted if one falls
short of it by more than 10 %, extended if both. Growing or shrinking by the mean relative rate of the neighbour
distances, with hysteresis. Displaced by how far the centroid lies to the right of where the default formation
has it, seen along the direction of motion.

The default formation hangs on the mapped hand, which the goals of the drones that refer to the human give away.
A drone lags behind its set-point in proportion to its velocity, so along the *drones'* direction of motion the
lag has no sideways part: a formation in a curve is not displaced.
"""

import numpy as np

from glove_bridge.formation_state import (
    Geometry,
    Memory,
    Reading,
    Scene,
    area_of,
    area_ratio,
    pair_distances,
    pair_rates,
    right_of,
)
from glove_bridge.rules.thresholds import Thresholds
from shared.arrays import Vec


def read(geometry: Geometry, scene: Scene, memory: Memory, limits: Thresholds) -> tuple[Reading, Memory]:
    """Reads the state of a formation.

    Args:
        geometry: The default formation of the drones that are heard.
        scene: Those drones, in the geometry's order.
        memory: What the last call returned.
        limits: Thresholds.

    Returns:
        The reading and what to remember.
    """
    distances = pair_distances(scene.position, geometry.pairs)
    area = area_of(scene.position)
    ratio = area_ratio(area, geometry.area)
    trend = _trend(geometry, scene, memory.trend, limits)
    heading = _heading(scene, memory.heading, limits)
    displacement = _displacement(geometry, scene, right_of(heading))
    reading = Reading(
        area=area,
        area_ratio=ratio,
        distances=geometry.by_pair(distances),
        extent=_extent(np.append(distances / geometry.gaps, ratio), limits),
        trend=trend,
        displacement=displacement,
        side=limits.side(displacement),
    )
    return reading, Memory(trend, (float(heading[0]), float(heading[1])))


def _extent(ratios: Vec, limits: Thresholds) -> int:
    if ratios.max() > limits.extended:
        return 1
    return -1 if ratios.min() < limits.contracted else 0


def _trend(geometry: Geometry, scene: Scene, before: int, limits: Thresholds) -> int:
    if not geometry.pairs:
        return 0
    rates = pair_rates(scene.position, scene.velocity, geometry.pairs)
    rate = float(np.mean(rates / geometry.gaps))
    now = 1 if rate > 0.0 else -1
    needed = limits.trend_off if now == before else limits.trend_on
    return now if abs(rate) > needed else 0


def _heading(scene: Scene, before: tuple[float, float] | None, limits: Thresholds) -> Vec:
    """Returns the (2,) direction of motion; the last clear one while the formation hovers."""
    velocity: Vec = scene.velocity.mean(axis=0)
    speed = float(np.linalg.norm(velocity))
    if speed > limits.moving_mps:
        return velocity / speed
    return scene.forward if before is None else np.array(before)


def _displacement(geometry: Geometry, scene: Scene, right: Vec) -> float:
    if not geometry.rooted:
        return 0.0
    rest = geometry.rest @ scene.rotation.T
    rooted = list(geometry.rooted)
    hand = np.mean(scene.goal[rooted] - rest[rooted], axis=0)
    shift = scene.position.mean(axis=0) - rest.mean(axis=0) - hand
    return float(shift @ right)
