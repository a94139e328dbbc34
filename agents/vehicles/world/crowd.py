"""The walkers of the simulated world: they walk, and the world says where they are."""

from collections.abc import Sequence

from agents.vehicles.world.walkers import PERIOD_NS, obstacles_at
from shared.clock import NS_PER_S, Clock
from shared.codec import encode
from shared.cylinders import Cylinder, cylinder_of
from shared.scenario import Walker
from shared.topics import OBSTACLE
from shared.transport import Bus


class Crowd:
    """Everybody who walks, from the start of the world on.

    Args:
        bus: Where they are said to be.
        walkers: Of the scenario; they have the numbers 1, 2, ...
        clock: Clock of the process.
    """

    def __init__(self, bus: Bus, walkers: Sequence[Walker], clock: Clock) -> None:
        self._walkers = walkers
        self._clock = clock
        self._publish = [bus.publisher(OBSTACLE, id=number + 1) for number in range(len(walkers))]
        self._epoch = self._due_ns = clock()
        self._seq = 0

    def step(self) -> list[Cylinder]:
        """Says where everybody is, if it is time, and returns it."""
        if not self._walkers:
            return []
        now = self._clock()
        t = (now - self._epoch) / NS_PER_S
        states = obstacles_at(self._walkers, t, epoch=self._epoch, seq=self._seq, stamp_ns=now)
        if now >= self._due_ns:
            self._due_ns = max(self._due_ns + PERIOD_NS, now)
            self._seq += 1
            for publish, state in zip(self._publish, states, strict=True):
                publish(encode(state))
        return [cylinder_of(state) for state in states]
