"""Hands for tests: minimum-jerk strokes with their exact velocities, one sample per tick of 60 Hz."""

import math

import numpy as np
import numpy.typing as npt

from shared.clock import NS_PER_S
from shared.messages import HandSample, Wish

Vec = npt.NDArray[np.float64]

RATE_HZ = 60.0
REST = np.array([0.0, 0.0, 1.2])


def samples_of(position: Vec, velocity: Vec, wish: Wish = Wish.FLY) -> list[HandSample]:
    """Makes one sample per row of (T, 3) positions and velocities."""
    return [
        HandSample(
            epoch=0,
            seq=k,
            stamp_ns=round(k * NS_PER_S / RATE_HZ),
            position=tuple(p),
            velocity=tuple(v),
            yaw=0.0,
            mode=wish,
        )
        for k, (p, v) in enumerate(zip(position.tolist(), velocity.tolist(), strict=True))
    ]


def stroke(
    heading: float, length: float, peak: float, *, before: float = 0.3, after: float = 4.0
) -> list[HandSample]:
    """One minimum-jerk stroke from the rest position: heading in rad (0 = +x), m, m/s, rests in s."""
    duration = 1.875 * length / peak
    t = np.arange(0.0, before + duration + after, 1.0 / RATE_HZ) - before
    s = np.clip(t / duration, 0.0, 1.0)
    way = length * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    speed = length / duration * 30.0 * s**2 * (1.0 - s) ** 2
    direction = np.array([math.cos(heading), math.sin(heading), 0.0])
    return samples_of(REST + way[:, None] * direction, speed[:, None] * direction)


def still(seconds: float, position: Vec = REST, wish: Wish = Wish.FLY) -> list[HandSample]:
    """A hand at rest."""
    ticks = round(seconds * RATE_HZ)
    return samples_of(np.tile(position, (ticks, 1)), np.zeros((ticks, 3)), wish)
