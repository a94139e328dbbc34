"""Replay: byte by byte, in order, at its pace; on a clock that the test turns."""

import threading
from collections import defaultdict
from pathlib import Path

import pytest

from observer.trace.read import open_trace
from observer.trace.replay import PREFIX, Replayed, replay
from observer.trace.write import TraceWriter
from shared.memory_bus import MemoryBus, MemoryNetwork
from shared.topics import TOPICS
from shared.transport import Arrival, Inbox
from tests.traces import SCENARIO, STEP_NS, flight, write

PAYLOADS = flight(300)

Heard = dict[str, list[Arrival]]


class Patience(threading.Event):
    """Waits on a clock of its own, always a little too long; is set when asked to end."""

    def __init__(self, end_ns: int = 10**18, overshoot_ns: int = 0) -> None:
        super().__init__()
        self.now_ns = 0
        self._end_ns, self._overshoot_ns = end_ns, overshoot_ns

    def wait(self, timeout: float | None = None) -> bool:
        assert timeout is not None
        assert timeout < threading.TIMEOUT_MAX
        self.now_ns += round(timeout * 1e9) + self._overshoot_ns
        if self.now_ns > self._end_ns:
            self.set()
        return self.is_set()


def listen(folder: Path, patience: Patience, prefix: str, **options: float) -> tuple[Replayed, Heard]:
    network = MemoryNetwork()
    here, there = MemoryBus(network), MemoryBus(network)
    inbox = Inbox(lambda: patience.now_ns, depth=10_000)
    for topic in TOPICS:
        there.subscribe(prefix + topic.wildcard, inbox)
    records = open_trace(folder).records()
    done = replay(records, here, lambda: patience.now_ns, patience, prefix=prefix, **options)
    return done, inbox.take()


@pytest.mark.parametrize("prefix", [PREFIX, ""])
@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_every_byte_comes_in_order_and_at_its_time(tmp_path: Path, prefix: str, speed: float) -> None:
    write(tmp_path, PAYLOADS)
    done, heard = listen(tmp_path, Patience(), prefix, speed=speed)
    expected = defaultdict(list)
    for number, (key, payload) in enumerate(PAYLOADS):
        expected[prefix + key].append(Arrival(payload, round(number * STEP_NS / speed)))
    assert heard == expected
    assert done.messages == len(PAYLOADS)
    assert done.lateness_ms.p99 is not None
    assert done.lateness_ms.p99 < 0.01


def test_a_late_message_does_not_make_the_next_ones_late(tmp_path: Path) -> None:
    write(tmp_path, PAYLOADS)
    done, heard = listen(tmp_path, Patience(overshoot_ns=STEP_NS // 2), PREFIX)
    last = max(arrival.arrival_ns for arrivals in heard.values() for arrival in arrivals)
    assert last <= (len(PAYLOADS) - 1) * STEP_NS + STEP_NS // 2
    assert done.lateness_ms.p50 == pytest.approx(0.5, rel=0.02)


def test_a_silence_of_centuries_can_be_waited_for(tmp_path: Path) -> None:
    writer = TraceWriter(tmp_path, SCENARIO)
    for log_ns in (0, 2**64 - 1):
        writer.add(*PAYLOADS[0][:1], Arrival(PAYLOADS[0][1], log_ns))
    writer.close(0)
    done, _ = listen(tmp_path, Patience(end_ns=10**13), PREFIX)
    assert done.messages == 1


def test_it_ends_when_told_to(tmp_path: Path) -> None:
    write(tmp_path, PAYLOADS)
    done, heard = listen(tmp_path, Patience(end_ns=100 * STEP_NS), PREFIX)
    assert done.messages == sum(map(len, heard.values())) == 101


def test_nothing_is_under_the_keys_of_a_flight_unless_asked(tmp_path: Path) -> None:
    write(tmp_path, PAYLOADS)
    _, heard = listen(tmp_path, Patience(), PREFIX)
    assert heard
    assert all(key.startswith("replay/") for key in heard)
