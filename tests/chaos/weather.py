"""What a bad link does to packets, without I/O: delay, jitter, loss, duplicates, overtaking."""

import heapq
import random
from collections.abc import Iterator

from attrs import frozen


@frozen(kw_only=True)
class Weather:
    """How bad a link is, per direction.

    Attributes:
        delay: Mean delay, s.
        jitter: Largest deviation from it, uniform, s; at most the delay.
        loss: Probability that a packet is lost.
        duplicate: Probability that a packet that is not lost arrives twice, each with a delay of its own.
        overtaking: Whether a packet may arrive before one that was sent earlier.
    """

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    duplicate: float = 0.0
    overtaking: bool = True


FAIR = Weather()


class Line:
    """All packets under way, towards wherever they go.

    Args:
        seed: Of the chance that decides about each packet.
    """

    def __init__(self, seed: int = 0) -> None:
        self.weather = FAIR
        self._random = random.Random(seed)
        self._under_way: list[tuple[float, int, bytes]] = []
        self._sent = 0
        self._latest = -float("inf")

    def send(self, packet: bytes, now: float) -> None:
        """Puts a packet on its way.

        Args:
            packet: The bytes.
            now: Time, s.
        """
        weather = self.weather
        if self._random.random() < weather.loss:
            return
        for _ in range(2 if self._random.random() < weather.duplicate else 1):
            due = now + weather.delay + self._random.uniform(-weather.jitter, weather.jitter)
            if not weather.overtaking:
                due = max(due, self._latest)
            self._latest = max(self._latest, due)
            heapq.heappush(self._under_way, (due, self._sent, packet))
            self._sent += 1

    @property
    def next_due(self) -> float | None:
        """Time at which the next packet arrives, s; None if none is under way."""
        return self._under_way[0][0] if self._under_way else None

    def arrivals(self, now: float) -> Iterator[bytes]:
        """Takes out the packets that have arrived, in order of their arrival."""
        while self._under_way and self._under_way[0][0] <= now:
            yield heapq.heappop(self._under_way)[2]
