"""A stand-in for a large swarm: one process says what all its drones would say, on a circle. Nothing flies.

Thirty-two agents need more than two cores; the page must not care.
"""

import math
import sys
import time

from shared.bus import ZenohBus
from shared.clock import system_clock
from shared.codec import encode
from shared.config import load_scenario
from shared.formation import build_formation
from shared.messages import DroneState, HandSample, Mode, Vector, Wish
from shared.net.settings import peer_settings
from shared.nodes import all_nodes, endpoint
from shared.topics import DRONE_STATE, HAND

RATE_HZ = 60.0
RADIUS_M = 0.8
RATE_RAD_S = 0.5


def speak(file: str) -> None:
    """Publishes states and the hand until killed."""
    scenario = load_scenario(file)
    formation = build_formation(scenario)
    clock = system_clock()
    listen = endpoint(scenario, formation, all_nodes(formation)[0])
    with ZenohBus(peer_settings(scenario.swarm.name, listen)) as bus:
        hand = bus.publisher(HAND)
        drones = {i: bus.publisher(DRONE_STATE, id=i) for i in formation.ids}
        start, seq = clock(), 0
        while True:
            now = clock()
            centre = _on_circle(RATE_RAD_S * (now - start) / 1e9)
            hand(encode(_hand(centre, start, seq, now)))
            for i, publish in drones.items():
                x, y, z = formation.rest[formation.row(i)]
                place = (x + centre[0], y + centre[1], z + centre[2])
                publish(encode(_state(i, place, start, seq, now)))
            seq += 1
            time.sleep(1 / RATE_HZ)


def _on_circle(angle: float) -> Vector:
    return (RADIUS_M * math.cos(angle), RADIUS_M * math.sin(angle), 1.2)


def _hand(place: Vector, epoch: int, seq: int, now: int) -> HandSample:
    still = (0.0, 0.0, 0.0)
    return HandSample(
        epoch=epoch, seq=seq, stamp_ns=now, position=place, velocity=still, yaw=0.0, mode=Wish.FLY
    )


def _state(drone: int, place: Vector, epoch: int, seq: int, now: int) -> DroneState:
    still = (0.0, 0.0, 0.0)
    return DroneState(
        epoch=epoch,
        seq=seq,
        stamp_ns=now,
        id=drone,
        position=place,
        velocity=still,
        goal=place,
        goal_velocity=still,
        setpoint=place,
        mode=Mode.FOLLOW,
    )


if __name__ == "__main__":
    speak(sys.argv[1])
