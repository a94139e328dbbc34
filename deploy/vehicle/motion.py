"""How a body moved after its set-point: in a recorded flight, or a simulated body that is made to show it."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from agents.vehicles.bodies.fleet import BODIES, Flyer, advance, hover, park_fleet
from agents.vehicles.bodies.state import FLY
from observer.report.record import runs
from observer.report.source import open_record
from shared.arrays import Vec
from shared.errors import ConfigError
from shared.messages import Vector

RATE_HZ = 60.0
"""Rows per second."""
SECONDS = 60.0
"""How long a simulated body is flown, s."""
SHORTEST = 3.0
"""Shorter stretches of a flight are left out, s: the observer has to settle in them."""
SIMULATED = "sim:"
"""How the name of a simulated body is told from the path of a flight."""
_HOLD = 0.75
"""The set-point goes one way for this long, s."""
_FASTEST = np.array([1.0, 1.0, 0.5])
_GENTLE = 0.35
"""Share of what it can do that a set-point asks of a body: the model is linear, and no body at its limit is."""
_LOW, _HIGH = np.array([-2.0, -2.0, 0.8]), np.array([2.0, 2.0, 2.5])
_FAR, _LOOK = 6.0, 0.6
"""To see what it can do at most a body is sent so far, m, and watched for so long, s."""


class Motion(NamedTuple):
    """Stretches of a flight of one body, (T, 3) each, m, at `RATE_HZ`."""

    setpoint: list[Vec]
    position: list[Vec]


def body_of(source: str) -> str | None:
    """Returns the name of the simulated body that a source means, None for the path of a flight.

    Raises:
        ConfigError: There is no such body.
    """
    if not source.startswith(SIMULATED):
        return None
    body = source.removeprefix(SIMULATED)
    if body not in BODIES:
        raise ConfigError(f"{source}: no such simulated body; there are {', '.join(sorted(BODIES))}")
    return body


def flown(source: Path, drone: int | None = None) -> Motion:
    """Reads a recorded flight: a run directory, an MCAP file, a flight folder or a ROS bag.

    Args:
        source: Where it lies.
        drone: Whose motion; None: everybody's, as of one type of vehicle.

    Raises:
        ConfigError: There is none, it is too short, or the drone did not fly in it.
    """
    record = open_record(source)
    ids = record.formation.ids
    if drone is not None and drone not in ids:
        raise ConfigError(
            f"{source}: no drone {drone} in this flight; its drones are {', '.join(map(str, ids))}"
        )
    setpoint, position = [], []
    for row in range(len(ids)) if drone is None else (record.formation.row(drone),):
        both = np.hstack([record.setpoint[:, row], record.position[:, row]])
        for stretch in runs(both):
            if stretch.stop - stretch.start >= SHORTEST * RATE_HZ:
                setpoint.append(both[stretch, :3])
                position.append(both[stretch, 3:])
    return Motion(setpoint, position)


def excited(body: str, seed: int = 1) -> Motion:
    """Flies a simulated body after a set-point that wanders well within what the body can do."""
    rng, flyer, hard = np.random.default_rng(seed), _hovering(body), _GENTLE * hardest(body)[0]
    setpoint, velocity, wanted = np.array(flyer.body.position), np.zeros(3), np.zeros(3)
    told, seen = [], []
    for tick in range(round(SECONDS * RATE_HZ)):
        if tick % round(_HOLD * RATE_HZ) == 0:
            wanted = rng.uniform(-1.0, 1.0, 3) * _FASTEST
            wanted = np.where(setpoint < _LOW, abs(wanted), np.where(setpoint > _HIGH, -abs(wanted), wanted))
        velocity += np.clip(wanted - velocity, -hard / RATE_HZ, hard / RATE_HZ)
        setpoint = setpoint + velocity / RATE_HZ
        told.append(setpoint)
        seen.append(flyer.body.position)
        flyer = advance(flyer, FLY, _vector(setpoint), 1.0 / RATE_HZ)
    return Motion([np.array(told)], [np.array(seen)])


def hardest(body: str) -> tuple[float, float]:
    """Returns the largest acceleration that a simulated body reaches, horizontally and vertically, m/s^2.

    It is told a set-point that moves away ever faster; up and down count as the weaker of the two.
    """
    ways = [_rush(body, np.array(way)) for way in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0))]
    return ways[0], min(ways[1:])


def _rush(body: str, way: Vec) -> float:
    flyer, place = _hovering(body, 40.0), np.array([0.0, 0.0, 40.0])
    speeds = []
    for tick in range(round(_LOOK * RATE_HZ)):
        ahead = place + way * _FAR * (tick / (_LOOK * RATE_HZ)) ** 2
        flyer = advance(flyer, FLY, _vector(ahead), 1.0 / RATE_HZ)
        speeds.append(np.dot(flyer.body.velocity, way))
    # The mean over a tenth of a second: a controller's kick is no acceleration that one can fly with.
    return float((np.array(speeds[6:]) - np.array(speeds[:-6])).max() * RATE_HZ / 6.0)


def _hovering(body: str, height: float = 1.5) -> Flyer:
    return hover(park_fleet({1: body}, [(0.0, 0.0, height)])[1])


def _vector(values: Vec) -> Vector:
    x, y, z = values.tolist()
    return (x, y, z)
