"""The hand per tick: a source's poses through the relay's own core, and what the formation makes of them."""

import itertools
from collections.abc import Iterable
from contextlib import closing

import numpy as np
from attrs import field, frozen

from agents.agent import hand_input
from agents.control.hand import HandSettings, map_hand
from deploy.lockstep.ticks import tick_ns
from human_relay.relay import RelayState, make_sample
from human_relay.sources import open_source
from shared.clock import NS_PER_S
from shared.formation import Vec
from shared.messages import HandSample


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


def relayed(uri: str, seconds: float, rate_hz: float) -> list[HandSample]:
    """Plays a hand source through the relay's core, one sample per tick.

    Args:
        uri: Hand source, for example `scripted:tour`.
        seconds: Longest play, s; a source that ends earlier ends it.
        rate_hz: Ticks per second.

    Raises:
        ConfigError: The source is unknown, missing or wrong.
    """
    samples, state = [], RelayState(epoch=0)
    with closing(open_source(uri, 0)) as source:
        for tick in itertools.count():
            now = tick_ns(tick, rate_hz)
            pose = source.poll(now)
            if source.finished or now > seconds * NS_PER_S:
                break
            state, sample = make_sample(state, pose, now)
            samples.append(sample)
    return samples


def track_hand(samples: Iterable[HandSample], settings: HandSettings) -> HandTrack:
    """Maps every sample of a flying hand.

    Args:
        samples: One per tick, at least one.
        settings: Mapping and clamps of the scenario.
    """
    inputs = [hand_input(sample) for sample in samples]
    mapped = [map_hand(None, inputs[0], settings)]
    for later in inputs[1:]:
        mapped.append(map_hand(mapped[-1], later, settings))
    return HandTrack(
        t=np.array([each.stamp for each in inputs]),
        position=np.array([each.position for each in inputs]),
        velocity=np.array([each.velocity for each in inputs]),
        point=np.array([each.point for each in mapped]),
        point_velocity=np.array([each.velocity for each in mapped]),
        yaw=np.array([each.yaw for each in mapped]),
        yaw_rate=np.array([each.yaw_rate for each in mapped]),
    )
