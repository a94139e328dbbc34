"""The hand per tick: a source's poses through the relay's own core, and what the formation makes of them."""

import itertools
from collections.abc import Iterable, Sequence
from contextlib import closing

import numpy as np
from attrs import field, frozen
from msgspec.structs import replace

from agents.agent import hand_input
from agents.control.hand import HandInput, HandSettings, MappedHand, map_hand
from deploy.lockstep.ticks import tick_ns
from human_relay.relay import RelayState, due_ns, make_sample
from human_relay.sources import open_source
from shared.arrays import Vec
from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.messages import HandSample
from shared.topics import HAND


@frozen(kw_only=True)
class HandTrack:
    """A hand over T ticks, and the mapped hand that agents in FOLLOW make of it.

    Attributes:
        t: (T,) s.
        position: (T, 3) m.
        velocity: (T, 3) m/s.
        point: (T, 3) mapped hand, m.
        point_velocity: (T, 3) m/s.
        yaw: (T,) heading of the formation, rad.
        yaw_rate: (T,) rad/s.
    """

    t: Vec = field(eq=False)
    position: Vec = field(eq=False)
    velocity: Vec = field(eq=False)
    point: Vec = field(eq=False)
    point_velocity: Vec = field(eq=False)
    yaw: Vec = field(eq=False)
    yaw_rate: Vec = field(eq=False)


def relayed(uri: str, seconds: float, rate_hz: float, hand_hz: float = HAND.rate_hz) -> list[HandSample]:
    """Plays a hand source through the relay's core: what agents hear newest at each tick.

    The relay takes poses at their time and sends them at its own rate; it does so here, on the virtual clock.

    Args:
        uri: Hand source, for example `scripted:tour`.
        seconds: Longest play, s; a source that ends earlier ends it.
        rate_hz: Ticks per second.
        hand_hz: Samples that the relay sends per second.

    Raises:
        ConfigError: The source is unknown, missing or wrong, or over at once.
    """
    state, at = RelayState(epoch=0, period_ns=round(NS_PER_S / hand_hz)), 0
    samples = list[HandSample]()
    with closing(open_source(uri, 0)) as source:
        state, newest = make_sample(state, source.poll(0), 0)
        for tick in itertools.count():
            now = tick_ns(tick, rate_hz)
            while at <= now:
                offered = source.poll(at)
                if at >= due_ns(state, offered):
                    state, newest = make_sample(state, offered, at)
                at = max(at + 1, min(source.next_ns(at), due_ns(state, offered)))
            if source.finished or now > seconds * NS_PER_S:
                break
            samples.append(replace(newest, seq=tick, stamp_ns=now))
    if not samples:
        raise ConfigError(f"{uri}: the hand is over before it has begun; there is nothing to fly")
    return samples


def map_samples(samples: Iterable[HandSample], settings: HandSettings) -> list[tuple[HandInput, MappedHand]]:
    """Maps every sample of a flying hand.

    Args:
        samples: One per tick, at least one.
        settings: Mapping and clamps of the scenario.
    """
    mapped: list[tuple[HandInput, MappedHand]] = []
    before: MappedHand | None = None
    for sample in map(hand_input, samples):
        before = map_hand(before, sample, settings)
        mapped.append((sample, before))
    return mapped


def track_of(hands: Sequence[tuple[HandInput, MappedHand]]) -> HandTrack:
    """Returns samples and what was made of them as arrays."""
    return HandTrack(
        t=np.array([sample.stamp for sample, _ in hands]),
        position=np.array([sample.position for sample, _ in hands]),
        velocity=np.array([sample.velocity for sample, _ in hands]),
        point=np.array([mapped.point for _, mapped in hands]),
        point_velocity=np.array([mapped.velocity for _, mapped in hands]),
        yaw=np.array([mapped.yaw for _, mapped in hands]),
        yaw_rate=np.array([mapped.yaw_rate for _, mapped in hands]),
    )
