"""What does not change during a flight, as the page draws it; and the mapping between its hand and the relay's.

Pure.
"""

import numpy as np

from observer.console.protocol import PROTOCOL_VERSION, Json
from shared.arrays import Vec
from shared.cylinders import columns_of
from shared.fence import fence_box, goal_box, hand_box
from shared.formation import Formation
from shared.messages import Vector
from shared.scenario import Scenario
from shared.shapes import HUMAN

CLEARANCE = 0.5
"""A page keeps the mapped hand so far above the floor of the fence, m: nobody is flown into the ground."""


class HandMap:
    """Between the mapped hand, which pages see and move, and the hand that the relay broadcasts.

    Args:
        scenario: Its `[hand]` says how the swarm maps.
        formation: Its room inside the fence bounds the mapped hand.
    """

    def __init__(self, scenario: Scenario, formation: Formation) -> None:
        hand = scenario.hand
        (a, b, lowest), (c, d, highest) = hand_box(scenario, formation)
        floor, ceiling = (corner[2] for corner in goal_box(scenario, formation))
        top = min(highest, ceiling)
        self.low: Vector = (a, b, min(max(lowest, floor + CLEARANCE), top))
        self.high: Vector = (c, d, top)
        self._fixed_height = hand.height
        self._offset, self._gain = np.zeros(3), 1.0
        if hand.mapping == "relative":
            self._offset, self._gain = np.array(hand.offset), hand.gain
        self.start = self._clamped(np.array([*hand.home, hand.height or scenario.limits.takeoff_height]))

    def mapped(self, real: Vector) -> Vector:
        """Returns where a broadcast hand (world frame, m) puts the mapped hand once the swarm has caught up."""
        return self._clamped(self._offset + self._gain * np.array(real))

    def real(self, mapped: Vector) -> Vector:
        """Returns the hand to broadcast for a mapped one (world frame, m), which is clamped to its box."""
        return _vector((np.array(self._clamped(np.array(mapped))) - self._offset) / self._gain)

    def _clamped(self, point: Vec) -> Vector:
        if self._fixed_height is not None:
            point = np.array([point[0], point[1], self._fixed_height])
        return _vector(np.minimum(np.maximum(point, self.low), self.high))


def scene(scenario: Scenario, formation: Formation, hand: HandMap) -> Json:
    """Returns the `scene` message, without the number of the page."""
    low, high = fence_box(scenario, formation)
    reach = scenario.avoidance.columns.d0
    columns = zip(scenario.obstacles, columns_of(scenario), strict=True)
    return {
        "type": "scene",
        "version": PROTOCOL_VERSION,
        "swarm": scenario.swarm.name,
        "law": scenario.swarm.law,
        "can_steer": bool(scenario.net.pointer),
        "hand": {
            "start": hand.start,
            "low": hand.low,
            "high": hand.high,
            "max_speed": scenario.hand.max_speed,
            "fixed_height": scenario.hand.height is not None,
            "follow_yaw": scenario.hand.follow_yaw,
        },
        "takeoff_height": scenario.limits.takeoff_height,
        "fence": {"min": low, "max": high},
        "obstacles": [
            {
                "name": column.name,
                "x": column.x,
                "y": column.y,
                "radius": cylinder.radius,
                "range": cylinder.radius + reach,
                "height": min(cylinder.high, high[2]),
            }
            for column, cylinder in columns
        ],
        "drones": [_drone(formation, drone) for drone in formation.ids],
        "links": [
            {
                "name": link.name,
                "from": formation.ids[link.source - 1] if link.source else HUMAN,
                "to": formation.ids[link.target],
                "limit": link.limit,
            }
            for link in formation.links
        ],
    }


def _drone(formation: Formation, drone: int) -> Json:
    human = (HUMAN,) if formation.refers_to_human(drone) else ()
    return {
        "id": drone,
        "references": [*human, *formation.references(drone)],
        "rest": formation.rest[formation.row(drone)],
    }


def _vector(array: Vec) -> Vector:
    x, y, z = array.tolist()
    return (x, y, z)
