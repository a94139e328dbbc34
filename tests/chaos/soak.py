"""Soak: `python -m tests.chaos.soak [--minutes 30] [--drones 8]`, as root: fault after fault on one flight.

What lives through all of them must not grow: memory, threads and open files of every process that was never
killed since the warm-up, then and at the end, both times with everybody in formation. Exit code 0: it did not,
everybody was back after every fault, nobody touched anybody, and nothing was left behind.

Memory is what is resident, and of that also what is the process's own, no file's. The warm-up is a minute of
calm flight and every fault twice, for code of the libraries becomes resident when it first runs, and much of it
first runs in a fault. What was held before these faults is printed as well, for comparison.
"""

import argparse
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from attrs import frozen

from deploy.bench.usage import read_usage
from shared.messages import Mode
from shared.nodes import RELAY, drone_node
from tests.chaos.flight import ChaosFlight, chaos_flight
from tests.chaos.lab import PREFIX, obstacle
from tests.chaos.watch import Watch

WARM_UP_S = 60.0
WARM_UP_ROUNDS = 2
CALM_S = 6.0
FAULT_S = 3.0
RECOVERY_S = 60.0
SETTLE_S = 15.0
"""Zenoh keeps a thread that has looked up an address for ten seconds."""
READINGS = 5
LARGEST_GROWTH = 0.02
SPARED = 2
"""So many drones, the last ones, are never killed: they show what grows."""

Fault = tuple[str, Callable[[], None]]


@frozen
class Holdings:
    """What a process holds: own memory and all that is resident, MB; threads; open files and sockets."""

    own_mb: float
    rss_mb: float
    threads: int
    files: int


def holdings(flight: ChaosFlight) -> dict[str, Holdings]:
    """Reads what every process holds for good: the least of some readings, for links come and go."""
    readings = []
    for _ in range(READINGS):
        readings.append({token: _held(process.pid) for token, process in flight.processes.items()})
        flight.recorder.listen(1.0)
    return {
        token: Holdings(
            min(held[token].own_mb for held in readings),
            min(held[token].rss_mb for held in readings),
            min(held[token].threads for held in readings),
            min(held[token].files for held in readings),
        )
        for token in readings[0]
    }


def _held(pid: int) -> Holdings:
    threads, files = (len(list(Path(f"/proc/{pid}/{name}").iterdir())) for name in ("task", "fd"))
    return Holdings(_own_mb(pid), read_usage(pid).rss_mb, threads, files)


def _own_mb(pid: int) -> float:
    lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    return next(int(line.split()[1]) * 1024 / 1e6 for line in lines if line.startswith("RssAnon:"))


def inhabitants() -> set[int]:
    """Returns every process that runs in a namespace of the lab."""
    spaces = [space.name for space in Path("/run/netns").glob(f"{PREFIX}*")]
    found = [
        subprocess.run(["/usr/bin/env", "ip", "netns", "pids", space], check=True, capture_output=True).stdout
        for space in spaces
    ]
    return {int(pid) for pids in found for pid in pids.split()}


def faults(flight: ChaosFlight, chance: random.Random) -> list[Fault]:
    """Returns the faults that may happen next."""
    victim = chance.choice(flight.ids[:-SPARED])
    away = chance.sample(flight.ids, k=2)

    def kill(token: str) -> None:
        flight.kill(token)
        flight.recorder.listen(0.25)
        flight.start(token)

    def hit(fault: Callable[[], None]) -> None:
        fault()
        flight.recorder.listen(FAULT_S)
        flight.lab.heal()

    nodes = [drone_node(drone) for drone in away]
    rest = [node for node in flight.nodes if node not in nodes]
    others = [node for node in flight.nodes if node != RELAY]
    return [
        ("kill a drone", lambda: kill(f"drone/{victim}")),
        ("kill the relay", lambda: kill("relay/0")),
        ("kill the bridge", lambda: kill("bridge/0")),
        ("freeze a drone for 0.3 s", lambda: flight.pause(f"drone/{victim}", 0.3)),
        ("part two drones for 3 s", lambda: hit(lambda: flight.lab.part(nodes, rest))),
        ("part the relay for 3 s", lambda: hit(lambda: flight.lab.part([RELAY], others))),
        ("lose 10 % for 3 s", lambda: hit(lambda: flight.lab.lose(0.1))),
    ]


def main() -> int:
    """Flies, hurts, measures; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.chaos.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--drones", type=int, default=8)
    parser.add_argument(
        "--links", choices=("tcp", "udp"), default="tcp", help="docs/chaos.md has their weather"
    )
    arguments = parser.parse_args()
    if reason := obstacle():
        print(f"soak: {reason}", file=sys.stderr)
        return 2
    with chaos_flight(
        Path(tempfile.mkdtemp(prefix="soak-")),
        "scripted:tour?peak=0.3",
        "grid",
        protocol=arguments.links,
        overrides=[f"formation.n={arguments.drones}"],
    ) as flight:
        faulty = soak(flight, 60.0 * arguments.minutes)
    left = [space.name for space in Path("/run/netns").glob(f"{PREFIX}*")]
    print(f"left behind: {', '.join(left) or 'nothing'}")
    return 1 if faulty or left else 0


def soak(flight: ChaosFlight, seconds: float) -> bool:
    """Soaks one flight; returns whether anything was wrong."""
    chance = random.Random(8)
    back: dict[str, list[float]] = {}
    cold = warm_up(flight, chance, back)
    before, pids = holdings(flight), {token: process.pid for token, process in flight.processes.items()}
    print("warm; what every process holds now counts", flush=True)
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0.0:
        suffer(flight, chance.choice(faults(flight, chance)), back)
        print(f"{left:.0f} s left; {memory(flight, pids)}", flush=True)
    for name, times in sorted(back.items()):
        print(f"{name}: {len(times)} times, all back after {max(times):.2f} s at most")
    strangers = inhabitants() - {process.pid for process in flight.processes.values()}
    print(f"processes that nobody knows: {strangers or 'none'}")
    referee = Watch(flight, 0, flight.ids).referee()
    print(f"referee: {referee}")
    wrong = referee["collisions"] > 0 or referee["fence_exits"] > 0 or bool(strangers)
    wrong |= any(took == float("inf") for times in back.values() for took in times)
    return grown(flight, cold, before, pids) or wrong


def warm_up(flight: ChaosFlight, chance: random.Random, back: dict[str, list[float]]) -> dict[str, Holdings]:
    """Flies a minute, then has every fault happen; returns what was held after that minute."""
    flight.recorder.listen(WARM_UP_S)
    cold = holdings(flight)
    for _ in range(WARM_UP_ROUNDS):
        for fault in faults(flight, chance):
            suffer(flight, fault, back)
    return cold


def suffer(flight: ChaosFlight, fault: Fault, back: dict[str, list[float]]) -> None:
    """Has a fault happen, waits until everybody is back, notes how long that took, and gives them a moment."""
    name, happen = fault
    happen()
    back.setdefault(name, []).append(recovery(flight))
    print(f"{name}, all back after {back[name][-1]:.2f} s", flush=True)
    flight.recorder.listen(CALM_S)
    flight.recorder.forget(CALM_S)


def survivors(flight: ChaosFlight, pids: dict[str, int]) -> list[str]:
    """Returns the processes that are still those of `pids`: they were never killed."""
    return [token for token, pid in sorted(pids.items()) if flight.processes[token].pid == pid]


def memory(flight: ChaosFlight, pids: dict[str, int]) -> str:
    """Says what every process that was never killed holds now, own and resident: a point of its curve."""
    held = {token: _held(pids[token]) for token in survivors(flight, pids)}
    return ", ".join(f"{token} {one.own_mb:.2f} of {one.rss_mb:.2f}" for token, one in held.items()) + " MB"


def recovery(flight: ChaosFlight) -> float:
    """Waits until everybody follows; returns how long that took, s; infinite: not in `RECOVERY_S`."""
    try:
        return flight.recorder.until(lambda: flight.recorder.all_in(Mode.FOLLOW), RECOVERY_S)
    except AssertionError as sight:
        print(sight)
        return float("inf")


def grown(
    flight: ChaosFlight, cold: dict[str, Holdings], before: dict[str, Holdings], pids: dict[str, int]
) -> bool:
    """Compares what the processes that were never killed hold with what they held; returns whether one grew."""
    wrong = False
    flight.recorder.listen(SETTLE_S)
    after = holdings(flight)
    for token in survivors(flight, pids):
        one, other = before[token], after[token]
        own, resident = other.own_mb / one.own_mb - 1.0, other.rss_mb / one.rss_mb - 1.0
        print(f"{token}: own {own:+.1%}, resident {resident:+.1%}: {cold[token]} -> {one} -> {other}")
        wrong |= max(own, resident) >= LARGEST_GROWTH
        wrong |= other.threads > one.threads or other.files > one.files
    return wrong


if __name__ == "__main__":
    sys.exit(main())
