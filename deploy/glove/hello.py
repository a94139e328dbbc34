"""`swarmtouch glove hello`: what the device says of itself, and how fast it answers."""

import argparse
import statistics
import time

from deploy.glove.device import worn_on_serial
from glove_bridge.gloves.serial import SerialGlove
from shared.errors import DeviceError

_ROUNDS = 10


def run(arguments: argparse.Namespace) -> int:
    """Prints it.

    Raises:
        DeviceError: The device does not answer.
    """
    with worn_on_serial(arguments.glove) as glove:
        device = glove.link.session.device
        rounds = _round_trips_ms(glove)
    if device is None or not rounds:
        raise DeviceError("the glove went away")
    rows = {
        "firmware": f"{'.'.join(map(str, device.firmware))}, protocol {device.protocol}",
        "motors": str(device.motors),
        "patterns": f"up to {device.max_frames} frames and {device.max_pattern_ms} ms",
        "dead-man": f"{device.deadman_ms} ms",
        "round trip": f"{statistics.median(rounds):.1f} ms (worst of {len(rounds)}: {max(rounds):.1f})",
    }
    for name, value in rows.items():
        print(f"{name:<11} {value}")
    return 0


def _round_trips_ms(glove: SerialGlove) -> list[float]:
    """Waits for some of the PINGs that keep the session alive."""
    rounds: list[float] = []
    session, seen = glove.link.session, 0
    while len(rounds) < _ROUNDS and glove.connected:
        if session.answers > seen and session.round_trip_ns is not None:
            seen = session.answers
            rounds.append(session.round_trip_ns / 1e6)
        time.sleep(0.01)
    return rounds
