"""The recorder's loop, over the bus within one process."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from observer.trace.read import open_trace
from observer.trace.record import run
from observer.trace.write import TraceWriter
from shared.clock import system_clock
from shared.codec import decode, encode
from shared.errors import DeviceError
from shared.memory_bus import MemoryBus, MemoryNetwork
from shared.messages import ProcessStatus
from shared.topics import DRONE_STATE, HAND, STATUS
from shared.transport import Inbox
from tests.traces import SCENARIO, hand, state


@contextmanager
def recorder(folder: Path, network: MemoryNetwork, inbox: Inbox) -> Iterator[threading.Event]:
    """Records in a thread until the end of the block or until the event is set."""
    bus, stopping = MemoryBus(network), threading.Event()
    arguments = (TraceWriter(folder, SCENARIO), bus, inbox, system_clock(), stopping)
    thread = threading.Thread(target=run, args=arguments)
    thread.start()
    try:
        assert _announced(network)
        yield stopping
    finally:
        stopping.set()
        thread.join(10.0)
        assert not thread.is_alive()


def _announced(network: MemoryNetwork) -> bool:
    """Waits until a recorder listens: it announces itself and says its first status after subscribing."""
    inbox = Inbox(system_clock())
    bus = MemoryBus(network)
    bus.subscribe(STATUS.wildcard, inbox)
    heard = inbox.wait(5.0)
    bus.close()
    return heard


def test_everything_that_is_said_is_recorded_in_order(tmp_path: Path) -> None:
    network = MemoryNetwork()
    swarm = MemoryBus(network)
    said = []
    with recorder(tmp_path, network, Inbox(system_clock(), 4096)):
        one, two = swarm.publisher(HAND), swarm.publisher(DRONE_STATE, id=1)
        for seq in range(500):
            for key, publish, payload in (
                (HAND.key(), one, encode(hand(seq))),
                ("drone/1/state", two, encode(state(1, seq)) if seq % 7 else b"no message"),
            ):
                publish(payload)
                said.append((key, payload))
    trace = open_trace(tmp_path)
    records = list(trace.records())
    assert [(record.key, record.payload) for record in records] == said
    stamps = [record.log_ns for record in records]
    assert stamps == sorted(stamps)
    assert trace.faults == []


def test_last_words_are_recorded_and_its_own_say_how_it_went(tmp_path: Path) -> None:
    network = MemoryNetwork()
    swarm, ear = MemoryBus(network), Inbox(system_clock(), 100)
    swarm.subscribe(STATUS.wildcard, ear)
    with recorder(tmp_path, network, Inbox(system_clock(), 4096)) as stopping:
        publish = swarm.publisher(HAND)
        publish(encode(hand(1)))
        stopping.set()
        publish(encode(hand(2)))
    assert [record.seq for record in open_trace(tmp_path).records()] == [1, 2]
    statuses = [decode(arrival.payload, ProcessStatus) for arrival in ear.take()["status/observer/0"]]
    *before, last = statuses
    assert {status.state for status in before} == {"running"}
    assert last.state == "ending"
    assert statuses[-1].metrics == {"dropped": 0.0}


def test_what_it_could_not_keep_is_counted(tmp_path: Path) -> None:
    network = MemoryNetwork()
    swarm = MemoryBus(network)
    inbox = Inbox(system_clock(), depth=5)
    with recorder(tmp_path, network, inbox):
        publish = swarm.publisher(HAND)
        for seq in range(2000):
            publish(encode(hand(seq)))
    trace = open_trace(tmp_path)
    kept = len(list(trace.records()))
    assert kept < 2000
    assert kept + trace.dropped == 2000
    assert trace.faults


def test_a_full_disk_ends_the_recorder_with_a_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bus, writer = MemoryBus(MemoryNetwork()), TraceWriter(tmp_path, SCENARIO)

    def fail(_dropped: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(writer, "flush", fail)
    clock = system_clock()
    with pytest.raises(DeviceError, match="No space left on device; is the disk full"):
        run(writer, bus, Inbox(clock), clock, threading.Event())
    writer._file.close()
