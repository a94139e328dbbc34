"""Hand samples in the order they were sent, across restarts of the relay."""

from bisect import bisect_left, bisect_right

from shared.messages import HandSample, Heard

KEPT = 2048
"""Samples whose stamps are remembered (34 s at 60 Hz), at least."""


class HandLog:
    """Numbers hand samples consecutively and remembers when the recent ones were sent.

    The number of a sample counts what was *sent* (by `seq`), not what the observer received; a restarted
    relay (new epoch) continues the count.
    """

    def __init__(self) -> None:
        self._first: dict[int, int] = {}
        self._numbers: list[int] = []
        self._stamps: list[int] = []

    def add(self, sample: HandSample) -> None:
        """Takes the next sample; late and repeated ones are ignored.

        One that is further back than any that is late is where the relay really is: what was there before came
        out of the future (`shared.order`).
        """
        if sample.epoch not in self._first:
            self._first[sample.epoch] = self._numbers[-1] + 1 if self._numbers else 0
        number = self._first[sample.epoch] + sample.seq
        if self._numbers and number <= self._numbers[-1]:
            if self._numbers[-1] - number <= KEPT:
                return
            number = self._numbers[-1] + 1
            self._first[sample.epoch] = number - sample.seq
        self._numbers.append(number)
        self._stamps.append(sample.stamp_ns)
        if len(self._numbers) > 2 * KEPT:
            del self._numbers[:KEPT], self._stamps[:KEPT]

    def number(self, heard: Heard) -> int | None:
        """Returns the number of a sample that an agent heard, None if its epoch is unknown here."""
        first = self._first.get(heard.epoch)
        return None if first is None else first + heard.seq

    def stamp_ns(self, number: int) -> int | None:
        """Returns when a recent sample was sent, None if it was not received here or is long past."""
        index = bisect_left(self._numbers, number)
        found = index < len(self._numbers) and self._numbers[index] == number
        return self._stamps[index] if found else None

    def sent_by(self, stamp_ns: int) -> int | None:
        """Returns the number of the newest sample sent up to a moment, None if none was."""
        index = bisect_right(self._stamps, stamp_ns)
        return self._numbers[index - 1] if index else None
