"""A recorded flight whose recorder is killed on the way: what the trace holds, and its replay."""

import hashlib
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import attrs
import pytest
from attrs import frozen

from deploy.bench.usage import read_usage
from deploy.launcher.ports import free_ports
from deploy.launcher.process_table import resolve_scenario
from observer.link_stats import SwarmLinks
from observer.swarm import open_observer
from observer.trace.layout import trace_files
from observer.trace.order import Record
from observer.trace.read import open_trace
from observer.trace.replay import PREFIX
from observer.trace.write import TraceWriter
from shared.clock import NS_PER_S, system_clock
from shared.codec import encode
from shared.formation import build_formation
from shared.messages import Message, Mode, ProcessStatus
from shared.nodes import OBSERVER, all_nodes
from shared.scenario import Net
from shared.topics import DRONE_STATE, HAND, TOPICS
from shared.transport import Arrival, Inbox
from tests.integration.floor import Floor
from tests.integration.recorder import START_S, Recorder, slowest_rate_hz
from tests.integration.swarm import launched
from tests.integration.test_kill_flight import LOWEST_RATE_HZ

pytestmark = [
    pytest.mark.timeout(150),
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for the recorder in Linux's /proc"),
]

LOST_AT_KILL_NS = NS_PER_S // 2
"""Where the machine lets everybody run."""
MOST_LOST = 0.05
"""Fraction of best-effort messages that a link may lose on a busy machine; idle, it loses none."""
SHARE_OF_A_CORE = 0.25


@frozen
class Flown:
    """A flight that is over, and what was heard of it outside."""

    run: Path
    killed_ns: int
    landing_ns: int
    recorder: Recorder
    cores: float
    summary: dict[str, Any]
    launcher_log: str

    def heard(self) -> dict[tuple[str, int, int], Message]:
        """Returns everything that the ear outside heard, by key, epoch and seq."""
        states = [state for states in self.recorder.states.values() for state in states]
        hands = [(HAND.key(), hand) for hand in self.recorder.hands.values()]
        return {
            (key, message.epoch, message.seq): message
            for key, message in (*hands, *((DRONE_STATE.key(id=state.id), state) for state in states))
        }


def recorder_of(run: Path) -> int | None:
    """Returns the process that records a run, None if there is none."""
    wanted = [b"observer", b"--run-dir", str(run).encode()]
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_bytes().split(b"\0")
        except OSError:  # it has ended
            continue
        if all(word in words for word in wanted):
            return int(path.parent.name)
    return None


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flown]:
    runs = tmp_path_factory.mktemp("runs")
    with launched("rhombus", "scripted:tour?peak=0.4", runs, arguments=["--record"]) as flight:
        recorder, run = flight.recorder, (runs / "latest").resolve()
        recorder.listen(2.0)
        pid = recorder_of(run)
        assert pid is not None
        killed_ns = recorder.clock()
        os.kill(pid, signal.SIGKILL)
        recorder.until(lambda: len(trace_files(run)) == 2, START_S)
        recorder.listen(0.5)
        pid = recorder_of(run)
        assert pid is not None
        assert os.getpriority(os.PRIO_PROCESS, pid) > os.getpriority(os.PRIO_PROCESS, 0), "who flies goes first"
        begin, begin_ns = read_usage(pid), recorder.clock()
        recorder.listen(3.0)
        seconds = (recorder.clock() - begin_ns) / NS_PER_S
        cores = read_usage(pid).since(begin).cpu_s / seconds
        landing_ns = recorder.clock()
        summary = flight.end()
        recorder.drain()
        launcher = (runs / "launcher.log").read_text()
        yield Flown(run, killed_ns, landing_ns, recorder, cores, summary, launcher)


def test_a_killed_recorder_loses_half_a_second_and_the_flight_does_not_notice(flown: Flown) -> None:
    first, second = trace_files(flown.run)
    trace = open_trace(first)
    records = list(trace.records())
    assert trace.truncated
    late_ns = flown.recorder.floor.late_ms(100.0) * 1e6
    assert flown.killed_ns - max(record.log_ns for record in records) <= LOST_AT_KILL_NS + 2 * late_ns
    after = open_trace(second)
    assert next(after.records()).log_ns > flown.killed_ns
    assert not after.truncated
    for drone in flown.recorder.ids:
        since = flown.recorder.since(drone, flown.killed_ns - NS_PER_S)
        states = [state for state in since if state.step_ns < flown.landing_ns]
        assert len({state.epoch for state in states}) == 1
        assert {state.mode for state in states} == {Mode.FOLLOW}
        floor = flown.recorder.floor.slowest_share(states[0].step_ns)
        assert slowest_rate_hz(states) >= LOWEST_RATE_HZ * floor
    assert (flown.summary["landed"], flown.summary["restarts"], flown.summary["collisions"]) == (True, 1, 0)


def test_the_trace_holds_every_byte_that_was_said(flown: Flown) -> None:
    heard = flown.heard()
    for file in trace_files(flown.run):
        recorded = list(open_trace(file).messages())
        found = {(record.key, message.epoch, message.seq): record for record, message in recorded}
        assert len(found) == len(recorded), "nothing is recorded twice"
        common = heard.keys() & found.keys()
        assert len(common) > 500
        for place in common:
            record, message = found[place], heard[place]
            assert record.payload == encode(message)
            assert (record.seq, record.publish_ns) == (message.seq, message.stamp_ns)
            assert record.log_ns >= record.publish_ns
        check_loss(recorded, heard.keys() - found.keys())


def check_loss(recorded: list[tuple[Record, Message]], missing: set[tuple[str, int, int]]) -> None:
    """Loss is told as the gaps in the numbers, and covers what the ear outside heard and the trace lacks."""
    swarm = SwarmLinks()
    for record, message in recorded:
        swarm.add(record.key, message, record.log_ns)
    for row in swarm.rows():
        seqs = [(message.epoch, message.seq) for record, message in recorded if record.key == row.key]
        if row.listener == OBSERVER:
            lost = [place for place in missing if place[0] == row.key and min(seqs) < place[1:] < max(seqs)]
            assert len(lost) <= row.missing == gaps(seqs) <= MOST_LOST * row.messages + 1


def gaps(seqs: Iterable[tuple[int, int]]) -> int:
    """Counts the numbers that are missing between an epoch's first and last, (epoch, seq) given."""
    by_epoch: dict[int, set[int]] = {}
    for epoch, seq in seqs:
        by_epoch.setdefault(epoch, set()).add(seq)
    return sum(max(seen) - min(seen) + 1 - len(seen) for seen in by_epoch.values())


def test_last_words_are_in_the_trace_and_the_recorder_is_cheap(flown: Flown) -> None:
    statuses = [m for _, m in open_trace(flown.run).messages() if isinstance(m, ProcessStatus)]
    ended = {f"{status.role}/{status.id}" for status in statuses if status.state == "ending"}
    assert ended >= {"drone/1", "drone/2", "drone/3", "drone/4", "relay/0", "world/0"}
    assert flown.cores <= SHARE_OF_A_CORE
    assert "no sign of" not in flown.launcher_log, "the launcher sees the recorder"


def test_info_reads_the_damaged_trace_and_says_so(flown: Flown) -> None:
    command = [sys.executable, "-m", "deploy.cli", "trace", "info", str(flown.run)]
    told = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout
    assert "it has no end: its recorder was killed or still runs" in told
    assert re.search(r"drone/4/state +observer +\d+ +\d+\.\d", told)


@pytest.mark.parametrize("prefix", [PREFIX, ""])
def test_a_replay_is_byte_exact_in_order_and_on_time(flown: Flown, prefix: str, tmp_path: Path) -> None:
    run = on_free_ports(trace_files(flown.run)[1], tmp_path)
    trace = open_trace(run)
    sent: dict[str, list[bytes]] = {}
    for record in trace.records():
        sent.setdefault(prefix + record.key, []).append(record.payload)
    inbox = Inbox(system_clock(), depth=1_000_000)
    command = [sys.executable, "-m", "deploy.cli", "trace", "replay", str(run), "--delay", "4"]
    with open_observer(trace.scenario) as bus, Floor() as floor:
        for topic in TOPICS:
            bus.subscribe(prefix + topic.wildcard, inbox)
        done = subprocess.run(
            [*command, *([] if prefix else ["--as-live"])],
            capture_output=True,
            text=True,
            check=True,
            timeout=100,
        )
        inbox.wait(1.0)
        heard = inbox.take()
    assert heard.keys() == sent.keys()
    for key, payloads in sent.items():
        assert digest(arrival.payload for arrival in heard[key]) == digest(payloads), key
    # One moment without the processor makes more than one message in a hundred late.
    found = re.search(r"late by ([\d.]+) ms \(median\)", done.stdout)
    assert found
    assert float(found[1]) <= 2.0 + 2.0 * floor.late_ms()


def digest(payloads: Iterable[bytes]) -> str:
    """Hashes payloads, their number and their limits."""
    return hashlib.sha256(b"".join(hashlib.sha256(payload).digest() for payload in payloads)).hexdigest()


def on_free_ports(file: Path, folder: Path) -> Path:
    """Copies a trace to other ports: another test may have taken those of the flight."""
    trace = open_trace(file)
    raw = trace.scenario
    formation = build_formation(raw)
    tcp, (udp,) = free_ports(tcp=len(all_nodes(formation)), udp=1)
    scenario = resolve_scenario(attrs.evolve(raw, net=Net()), formation, tcp, udp)
    writer = TraceWriter(folder, scenario)
    for record in trace.records():
        writer.add(record.key, Arrival(record.payload, record.log_ns))
    writer.close(dropped=0)
    return folder
