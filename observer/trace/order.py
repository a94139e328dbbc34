"""The messages of a trace by the time at which they came, whatever their order in the file, in bounded memory.

Nothing in MCAP says that messages stand in order: a recorder with several threads, a merge or a repair leaves
them as they come. Whoever draws, aligns or replays them goes by time.
"""

import heapq
from collections.abc import Iterator
from typing import NamedTuple

WINDOW = 1 << 14
"""Records that are looked ahead: minutes of a few drones, seconds of many."""
_WINDOW_BYTES = 1 << 23


class Record(NamedTuple):
    """One recorded payload.

    Attributes:
        key: The key it was sent on, without the swarm's name.
        payload: The bytes as they were sent.
        seq: The publisher's `seq`, modulo 2^32; 0 if the payload is no valid message.
        publish_ns: The publisher's stamp (its clock); `log_ns` if the payload is no valid message.
        log_ns: When it arrived at the recorder (the recorder's clock).
    """

    key: str
    payload: bytes
    seq: int
    publish_ns: int
    log_ns: int


class TimeOrder:
    """Sorts records by `log_ns` as they are read; those of one time stay as they are.

    Args:
        window: How many records are looked ahead.

    Attributes:
        late: Records that came after later ones nevertheless: farther away in the file than is looked ahead.
    """

    def __init__(self, window: int = WINDOW) -> None:
        self.late = 0
        self._window = window

    def sort(self, records: Iterator[Record]) -> Iterator[Record]:
        """Yields all records."""
        waiting: list[tuple[int, int, Record]] = []
        size, newest_ns = 0, -1
        for number, record in enumerate(records):
            heapq.heappush(waiting, (record.log_ns, number, record))
            size += len(record.payload)
            while len(waiting) > self._window or size > _WINDOW_BYTES:
                _, _, earliest = heapq.heappop(waiting)
                size -= len(earliest.payload)
                self.late += earliest.log_ns < newest_ns
                newest_ns = max(newest_ns, earliest.log_ns)
                yield earliest
        for _, _, earliest in sorted(waiting):
            self.late += earliest.log_ns < newest_ns
            yield earliest
