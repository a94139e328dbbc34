"""The hand as the referee hears it: the world takes no other part in the swarm."""

from collections import Counter

import numpy as np

from agents.vehicles.bodies.state import Vec
from shared.clock import Clock
from shared.codec import decode
from shared.errors import DecodeError
from shared.messages import HandSample
from shared.topics import HAND
from shared.transport import Bus, Inbox


class HandWatch:
    """Newest valid hand position on the bus.

    Args:
        bus: Where `human/hand` is published.
        clock: Stamps arrivals.

    Attributes:
        rejected: Refused payloads by reason.
    """

    def __init__(self, bus: Bus, clock: Clock) -> None:
        self._inbox = Inbox(clock)
        self._position: Vec | None = None
        self.rejected: Counter[str] = Counter()
        bus.subscribe(HAND.key(), self._inbox)

    def position(self) -> Vec | None:
        """Returns the newest position (3,) in the world frame, m; None before the first."""
        for arrival in self._inbox.take().get(HAND.key(), ()):
            try:
                self._position = np.array(decode(arrival.payload, HandSample).position)
            except DecodeError as error:
                self.rejected[error.reason] += 1
        return self._position
