import itertools
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from human_relay.loop import run
from human_relay.relay import IMPOSSIBLE_POSE
from human_relay.sources import open_source
from shared.clock import NS_PER_S
from shared.codec import decode
from shared.memory_bus import MemoryBus, MemoryNetwork
from shared.messages import HandSample, ProcessStatus, Wish
from shared.topics import HAND, STATUS
from shared.transport import Inbox

START = 5_000 * NS_PER_S

Orders = Callable[[float], list[Wish]]


class Operator:
    """A virtual clock that waiting advances, and orders at given times."""

    def __init__(self, seconds: float, orders: dict[float, Wish] | None = None) -> None:
        self.now_ns = START
        self.stopping = threading.Event()
        self._end_ns = START + round(seconds * NS_PER_S)
        self._orders = {START + round(at * NS_PER_S): wish for at, wish in (orders or {}).items()}

    def clock(self) -> int:
        return self.now_ns

    def wait(self, timeout_s: float) -> list[Wish]:
        wake_ns = self.now_ns + max(0, round(timeout_s * NS_PER_S))
        due = min((at for at in self._orders if at <= wake_ns), default=None)
        self.now_ns = wake_ns if due is None else max(due, self.now_ns)
        if self.now_ns >= self._end_ns:
            self.stopping.set()
        return [] if due is None else [self._orders.pop(due)]


def relay(hand: str, operator: Operator) -> tuple[list[HandSample], list[ProcessStatus], MemoryBus]:
    """Runs the loop in virtual time and returns what the swarm received, and the relay's bus."""
    network = MemoryNetwork()
    inbox = Inbox(operator.clock, depth=100_000)
    swarm, bus = MemoryBus(network), MemoryBus(network)
    swarm.subscribe(HAND.wildcard, inbox)
    swarm.subscribe(STATUS.wildcard, inbox)
    run(open_source(hand, START), operator.wait, bus, operator.clock, operator.stopping)
    taken = inbox.take()
    samples = [decode(arrival.payload, HandSample) for arrival in taken[HAND.pattern]]
    status = [decode(arrival.payload, ProcessStatus) for arrival in taken[STATUS.key(role="relay", id=0)]]
    return samples, status, bus


def test_every_sample_of_the_source_is_sent_once_at_its_time() -> None:
    samples, _, _ = relay("scripted:tour?lead=0.5", Operator(seconds=3.0))
    assert [sample.seq for sample in samples] == list(range(180))
    assert [sample.stamp_ns for sample in samples] == [START + k * NS_PER_S // 60 for k in range(180)]
    assert {sample.epoch for sample in samples} == {START}


def test_after_the_end_it_says_land_at_60_hz() -> None:
    samples, _, _ = relay("scripted:hold?lead=0&duration=1", Operator(seconds=4.0))
    modes = [sample.mode for sample in samples]
    assert modes.index(Wish.LAND) == 60
    assert set(modes[60:]) == {Wish.LAND}
    assert len(samples) == pytest.approx(240, abs=3)
    assert samples[-1].velocity == (0.0, 0.0, 0.0)


def test_an_order_is_sent_at_once_and_repeated() -> None:
    operator = Operator(seconds=3.0, orders={1.005: Wish.HOLD, 2.005: Wish.STOP, 2.5: Wish.FLY})
    samples, _, _ = relay("scripted:tour?lead=0", operator)
    changes = {
        sample.mode: (sample.stamp_ns - START) / NS_PER_S
        for before, sample in itertools.pairwise(samples)
        if sample.mode != before.mode
    }
    assert changes == {Wish.HOLD: 1.005, Wish.STOP: 2.005}
    assert samples[-1].mode == Wish.STOP


def test_it_reports_once_a_second_and_at_the_end() -> None:
    samples, status, _ = relay("scripted:tour?lead=0", Operator(seconds=2.5))
    assert [report.state for report in status] == ["running", "running", "running", "ending"]
    assert {(report.role, report.id) for report in status} == {("relay", 0)}
    assert status[-1].metrics == {"samples": len(samples)}
    assert status[-1].rejected == {IMPOSSIBLE_POSE: 0}


def test_impossible_poses_are_counted_and_logged_now_and_then(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rows = [f"{k / 60},{1000 + k},2000,1200" for k in range(720)]
    (tmp_path / "mm.csv").write_text("\n".join(["t,x,y,z", *rows]) + "\n")
    samples, status, _ = relay(f"recording:{tmp_path / 'mm.csv'}?lead=0", Operator(seconds=11.5))
    assert {sample.mode for sample in samples} == {Wish.HOLD}
    assert status[-1].rejected == {IMPOSSIBLE_POSE: len(samples)}
    assert len(caplog.messages) == 3
    assert all("in metres?" in message for message in caplog.messages)
    assert "(1000, 2000, 1200) m" in caplog.messages[0]


def test_it_only_publishes() -> None:
    _, _, bus = relay("scripted:tour", Operator(seconds=0.1))
    assert bus._subscriptions == []
    assert bus.watchers == []
