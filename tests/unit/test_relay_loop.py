import itertools
import random
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from human_relay.loop import run
from human_relay.relay import HAND_JUMP, IMPOSSIBLE_POSE
from human_relay.sources import open_source
from human_relay.sources.base import HandPose
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


class Steady:
    """A source with a pose per period, some of them a little late."""

    def __init__(self, rate_hz: float, jitter_s: float = 0.0, stop_s: float = 1e9) -> None:
        self._rate_hz, self._jitter_s, self._stop_s = rate_hz, jitter_s, stop_s
        self._random = random.Random(1)
        self._upcoming = (0, START)
        self._current: HandPose | None = None
        self.finished = False
        self.remarks = ()

    def poll(self, now_ns: int) -> HandPose | None:
        number, at_ns = self._upcoming
        while now_ns >= at_ns:
            seconds = number / self._rate_hz
            mode = Wish.STOP if seconds >= self._stop_s else Wish.FLY
            self._current = HandPose(position=(0.1 * seconds, 0.0, 1.2), yaw=0.0, mode=mode, t_ns=at_ns)
            number += 1
            late_s = self._random.uniform(0.0, self._jitter_s)
            at_ns = START + round((number / self._rate_hz + late_s) * NS_PER_S)
        self._upcoming = (number, at_ns)
        return self._current

    def next_ns(self, _: int) -> int:
        return self._upcoming[1]

    def close(self) -> None:
        pass


def relay_of(source: Steady, hand_hz: float, seconds: float = 10.0) -> list[HandSample]:
    operator, network = Operator(seconds), MemoryNetwork()
    inbox = Inbox(operator.clock, depth=100_000)
    MemoryBus(network).subscribe(HAND.wildcard, inbox)
    bus = MemoryBus(network)
    run(source, operator.wait, bus, operator.clock, operator.stopping, hand_hz=hand_hz)
    return [decode(arrival.payload, HandSample) for arrival in inbox.take()[HAND.pattern]]


@pytest.mark.parametrize("hand_hz", [10.0, 20.0, 60.0, 100.0])
@pytest.mark.parametrize("source_hz", [90.0, 120.0, 240.0, 1000.0])
def test_a_fast_source_is_thinned_out_to_the_rate_of_the_hand_and_the_newest_pose_wins(
    source_hz: float, hand_hz: float
) -> None:
    samples = relay_of(Steady(source_hz, jitter_s=0.3 / source_hz), hand_hz)
    wanted = 10.0 * min(hand_hz, source_hz)
    assert 0.92 * wanted <= len(samples) <= 1.02 * wanted
    ages = [(s.stamp_ns - START) / NS_PER_S - s.position[0] / 0.1 for s in samples]
    assert max(ages) < 1.5 / source_hz
    gaps = [(b.stamp_ns - a.stamp_ns) / NS_PER_S for a, b in itertools.pairwise(samples)]
    assert max(gaps) < 1.0 / hand_hz + 1.6 / source_hz


@pytest.mark.parametrize("source_hz", [30.0, 59.9, 60.0, 60.1])
def test_a_source_at_about_the_rate_of_the_hand_never_waits(source_hz: float) -> None:
    jitter_s = 0.3 / source_hz
    samples = relay_of(Steady(source_hz, jitter_s), 60.0)
    fresh = {s.position: s for s in reversed(samples)}
    waited = [s.stamp_ns - START - round(s.position[0] / 0.1 * NS_PER_S) for s in fresh.values()]
    assert sum(wait > jitter_s * NS_PER_S + 1_000 for wait in waited) <= 5
    assert max(waited) < 1.1 / 60.0 * NS_PER_S
    assert len(fresh) >= 10.0 * min(source_hz, 60.0) - 3


def test_a_wish_is_never_thinned_out() -> None:
    (first, *_) = [s for s in relay_of(Steady(1000.0, stop_s=5.003), 10.0) if s.mode is Wish.STOP]
    assert (first.stamp_ns - START) / NS_PER_S == pytest.approx(5.003, abs=1e-6)


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
    assert status[-1].rejected == {IMPOSSIBLE_POSE: 0, HAND_JUMP: 0}


def test_impossible_poses_are_counted_and_logged_now_and_then(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rows = [f"{k / 60},{(-1) ** k * -15},0,1.2" for k in range(720)]
    (tmp_path / "hand.csv").write_text("\n".join(["t,x,y,z", *rows]) + "\n", encoding="ascii")
    samples, status, _ = relay(f"recording:{tmp_path / 'hand.csv'}?lead=0", Operator(seconds=11.5))
    held = [sample for sample in samples if sample.mode is Wish.HOLD]
    assert len(held) > 300
    assert all(sample.jumped for sample in held)
    assert status[-1].rejected == {IMPOSSIBLE_POSE: len(held), HAND_JUMP: len(held)}
    assert len(caplog.messages) == 3
    assert max(abs(sample.position[0] + 15.0) for sample in samples) < 1e-3
    assert all("in metres?" in message for message in caplog.messages)
    assert "(15, 0, 1.2) m" in caplog.messages[0]


def test_it_only_publishes() -> None:
    _, _, bus = relay("scripted:tour", Operator(seconds=0.1))
    assert bus._subscriptions == []
    assert bus.watchers == []
