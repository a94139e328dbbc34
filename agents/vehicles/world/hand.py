"""The hand as the referee hears it: the world takes no other part in the swarm."""

from collections import Counter

from shared.clock import Clock
from shared.messages import Vector
from shared.senses import Senses
from shared.signature import Verify
from shared.transport import Bus, Inbox


class HandWatch:
    """Newest valid hand position on the bus.

    Args:
        bus: Where `human/hand` is published.
        clock: Stamps arrivals.
        verify: Checks signatures; None accepts unsigned samples.
    """

    def __init__(self, bus: Bus, clock: Clock, verify: Verify | None = None) -> None:
        self._inbox = Inbox(clock)
        self._senses = Senses((), verify)
        for key in self._senses.keys:
            bus.subscribe(key, self._inbox)

    @property
    def rejected(self) -> Counter[str]:
        """Refused payloads by reason."""
        return self._senses.rejected

    def position(self) -> Vector | None:
        """Returns the newest position in the world frame, m; None before the first."""
        self._senses.take(self._inbox.take())
        hand = self._senses.hand
        return None if hand is None else hand.message.position
