"""The recorder's loop: receive -> write, whoever says whatever."""

import logging
import threading
import time
from collections.abc import Mapping, Sequence

from observer.trace.write import TraceWriter
from shared.clock import NS_PER_S, Clock
from shared.errors import DeviceError
from shared.nodes import OBSERVER
from shared.process import StatusReporter
from shared.topics import TOPICS
from shared.transport import Arrival, Bus, Inbox

INBOX_DEPTH = 4096
"""Samples kept per key between two rounds: a minute of a busy key, should the disk stall."""
FLUSH_PERIOD_S = 0.25
"""A recorder that is killed loses at most what came since the last flush."""
LINGER_S = 0.3
"""The last words of processes that are asked to end together with the recorder come after it was asked."""

_PERIOD_S = 0.02
_FLUSH_PERIOD_NS = round(FLUSH_PERIOD_S * NS_PER_S)
_log = logging.getLogger("recorder")


def run(
    writer: TraceWriter, bus: Bus, inbox: Inbox, clock: Clock, stopping: threading.Event, number: int = 0
) -> None:
    """Records until told to stop; then the trace is complete and closed.

    Args:
        writer: The new trace.
        bus: A connection to every node of the swarm.
        inbox: Where the bus is to put what it hears, `INBOX_DEPTH` deep.
        clock: The process's clock.
        stopping: Ends the loop.
        number: Number of this observer.

    Raises:
        DeviceError: The disk is full or gone; what has been flushed is safe.
    """
    status = StatusReporter(bus, OBSERVER, number, clock)
    for topic in TOPICS:
        bus.subscribe(topic.wildcard, inbox)
    _log.info("recording to %s", writer.path)
    try:
        _record(writer, inbox, clock, stopping, status)
    except OSError as error:
        raise DeviceError(f"{writer.path}: recording ends here: {error}; is the disk full?") from error
    _log.info("recorded %d messages, dropped %d", writer.written, inbox.dropped + writer.refused)


def _record(
    writer: TraceWriter, inbox: Inbox, clock: Clock, stopping: threading.Event, status: StatusReporter
) -> None:
    flush_ns = clock()
    while not stopping.wait(_PERIOD_S):
        _write(writer, inbox)
        if clock() >= flush_ns:
            flush_ns = clock() + _FLUSH_PERIOD_NS
            writer.flush(inbox.dropped)
        _tell(status, writer, inbox)
    _tell(status, writer, inbox, ending=True)
    time.sleep(LINGER_S)
    _write(writer, inbox)
    writer.close(inbox.dropped)


def in_order(taken: Mapping[str, Sequence[Arrival]]) -> list[tuple[str, Arrival]]:
    """Merges what an inbox held per key into one list by time of arrival."""
    merged = [(key, arrival) for key, arrivals in taken.items() for arrival in arrivals]
    return sorted(merged, key=lambda item: item[1].arrival_ns)


def _write(writer: TraceWriter, inbox: Inbox) -> None:
    for key, arrival in in_order(inbox.take()):
        writer.add(key, arrival)


def _tell(status: StatusReporter, writer: TraceWriter, inbox: Inbox, *, ending: bool = False) -> None:
    dropped = inbox.dropped + writer.refused
    word = "ending" if ending else "degraded" if dropped else "running"
    status.tick(writer.written, word, writer.rejected, lambda: {"dropped": float(dropped)}, force=ending)
