"""From what was heard to the scene that a rule reads. Pure."""

from collections.abc import Mapping, Sequence

import numpy as np

from glove_bridge.formation_state import Scene
from shared.arrays import Vec
from shared.messages import DroneState, Heard, Mode
from shared.senses import Sensed, Senses
from shared.topics import DRONE_STATE, HAND

FORMED = (Mode.FOLLOW, Mode.HOLD)
"""Modes in which a drone keeps its place in the formation."""

MOST_NAMED = 32
"""Of a larger swarm only the newest sample is named: all of them would not fit into a payload."""

DroneStates = Mapping[int, Sensed[DroneState]]


def missing_drones(
    ids: Sequence[int], drones: DroneStates, left_ns: Mapping[int, int], now_ns: int
) -> tuple[int, ...]:
    """Lists the drones that are not heard.

    Args:
        ids: Everybody.
        drones: The last state of each that was ever heard.
        left_ns: When the presence of a drone ended; it is missing from then on, until it is heard again.
        now_ns: The time.
    """

    def is_missing(drone: int) -> bool:
        sensed = drones.get(drone)
        if sensed is None or sensed.age(now_ns) > DRONE_STATE.stale_s:
            return True
        return left_ns.get(drone, 0) >= sensed.arrival_ns

    return tuple(drone for drone in ids if is_missing(drone))


def scene_of(drones: Sequence[Sensed[DroneState]], yaw: float, now_ns: int) -> Scene:
    """Puts the drones into one scene, all at the same moment.

    Args:
        drones: Their last states. The bodies are moved on with their velocity since these arrived, so that one
            state being newer than another does not deform the formation.
        yaw: Heading of the formation frame, rad.
        now_ns: The time.
    """

    def rows(name: str) -> Vec:
        return np.array([getattr(sensed.message, name)[:2] for sensed in drones])

    velocity = rows("velocity")
    ages = np.array([sensed.age(now_ns) for sensed in drones])
    return Scene(
        position=rows("position") + velocity * ages[:, None],
        velocity=velocity,
        goal=rows("goal"),
        setpoint=rows("setpoint"),
        yaw=yaw,
    )


def all_heard(senses: Senses, drones: DroneStates) -> dict[str, Heard]:
    """Names the samples that a state of the formation was computed from: the hand and these drones."""
    if len(drones) > MOST_NAMED:
        return newest_heard(senses)
    heard = {DRONE_STATE.key(id=drone): sensed.heard for drone, sensed in drones.items()}
    return heard if senses.hand is None else {HAND.key(): senses.hand.heard, **heard}


def newest_heard(senses: Senses) -> dict[str, Heard]:
    """Names the newest samples of the hand and of any drone: those that brought about what happens now."""
    newest = max(senses.drones.items(), key=lambda item: item[1].arrival_ns, default=None)
    return all_heard(senses, dict([newest] if newest else []))
