"""Says again what a trace holds, byte by byte, in order and at its pace."""

import threading
from collections.abc import Iterable

import attrs

from observer.histogram import Histogram, Quantiles
from observer.trace.order import Record
from shared.clock import NS_PER_S, Clock
from shared.errors import DecodeError
from shared.topics import Delivery, topic_of
from shared.transport import Bus, Publish

_LONGEST_WAIT_S = 3600.0
PREFIX = "replay/"
"""Before every key, unless the replay is to be taken for a live swarm."""


@attrs.frozen
class Replayed:
    """What a replay did: messages said, those left out that came on no key of a swarm, lateness, ms."""

    messages: int
    left_out: int
    lateness_ms: Quantiles


def replay(
    records: Iterable[Record],
    bus: Bus,
    clock: Clock,
    stopping: threading.Event,
    *,
    speed: float = 1.0,
    prefix: str = PREFIX,
) -> Replayed:
    """Publishes records at the pace at which they were recorded, by the recorder's clock.

    Args:
        records: What to say.
        bus: Where; nothing is published on it before the first record is due.
        clock: This process's clock.
        stopping: Ends the replay early.
        speed: 2.0 is twice as fast.
        prefix: What to put before every key.
    """
    publishers: dict[str, Publish] = {}
    lateness, messages, left_out = Histogram(), 0, 0
    start_ns = first_ns = 0
    for number, record in enumerate(records):
        if number == 0:  # reading up to it may have taken its time
            start_ns, first_ns = clock(), record.log_ns
        due_ns = start_ns + round((record.log_ns - first_ns) / speed)
        while (early_ns := due_ns - clock()) > 0 and not stopping.is_set():
            # No wait is as long as two times in a file can be apart.
            stopping.wait(min(early_ns / NS_PER_S, _LONGEST_WAIT_S))
        if stopping.is_set():
            break
        try:
            publish = publishers.get(record.key) or _publisher(bus, prefix, record.key)
        except DecodeError:
            left_out += 1
            continue
        publishers[record.key] = publish
        lateness.add(max(0, clock() - due_ns) / 1e6)
        publish(record.payload)
        messages += 1
    return Replayed(messages, left_out, lateness.quantiles())


def _publisher(bus: Bus, prefix: str, key: str) -> Publish:
    # What many processes said is now said by one, in bursts that overflow the one-message queue of a state.
    return bus.publisher(attrs.evolve(topic_of(key), pattern=prefix + key, delivery=Delivery.EVENT))
