"""Hears everything that a running swarm says, message by message, until Ctrl-C."""

import threading
from collections.abc import Iterator, Sequence

from observer.swarm import open_observer
from observer.trace.record import INBOX_DEPTH, in_order
from shared.clock import Clock
from shared.scenario import Scenario
from shared.transport import Arrival, Inbox


def listen(
    scenario: Scenario, keys: Sequence[str], clock: Clock, stopping: threading.Event, period_s: float
) -> Iterator[list[tuple[str, Arrival]]]:
    """Yields what has arrived on some keys, in order, every `period_s`; ends when told to stop.

    Args:
        scenario: The running scenario.
        keys: Key expressions.
        clock: Stamps arrivals.
        stopping: Ends it.
        period_s: Time between two batches; one may be empty.
    """
    inbox = Inbox(clock, INBOX_DEPTH)
    with open_observer(scenario) as bus:
        for key in keys:
            bus.subscribe(key, inbox)
        while not stopping.wait(period_s):
            yield in_order(inbox.take())
