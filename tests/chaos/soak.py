"""Soak: `python -m tests.chaos.soak [--minutes 30] [--drones 8]`, as root: fault after fault on one flight.

What lives through all of them must not grow: memory, threads and open files of every process that was never
killed, after a minute of flight and at the end, both times with everybody in formation. Exit code 0: it did
not, nobody touched anybody, and nothing was left behind.
"""

import argparse
import random
import sys
import tempfile
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
CALM_S = 6.0
FAULT_S = 3.0
RECOVERY_S = 30.0
LARGEST_GROWTH = 0.02
SPARED = 2
"""So many drones, the last ones, are never killed: they show what grows."""


@frozen
class Holdings:
    """What a process holds: resident memory, MB; threads; open files and sockets."""

    rss_mb: float
    threads: int
    files: int


def holdings(flight: ChaosFlight) -> dict[str, Holdings]:
    """Reads what every process holds now."""
    held = {}
    for token, process in flight.processes.items():
        folder = Path(f"/proc/{process.pid}")
        threads, files = (len(list((folder / name).iterdir())) for name in ("task", "fd"))
        held[token] = Holdings(read_usage(process.pid).rss_mb, threads, files)
    return held


def faults(flight: ChaosFlight, chance: random.Random) -> list[Callable[[], None]]:
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
    return [
        lambda: kill(f"drone/{victim}"),
        lambda: kill("relay/0"),
        lambda: kill("bridge/0"),
        lambda: flight.pause(f"drone/{victim}", 0.3),
        lambda: hit(lambda: flight.lab.part(nodes, rest)),
        lambda: hit(lambda: flight.lab.part([RELAY], rest)),
        lambda: hit(lambda: flight.lab.lose(0.1)),
    ]


def main() -> int:
    """Flies, hurts, measures; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.chaos.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--drones", type=int, default=8)
    arguments = parser.parse_args()
    if reason := obstacle():
        print(f"soak: {reason}", file=sys.stderr)
        return 2
    with chaos_flight(
        Path(tempfile.mkdtemp(prefix="soak-")),
        "scripted:tour?peak=0.3",
        "grid",
        protocol="udp",
        overrides=[f"formation.n={arguments.drones}"],
    ) as flight:
        faulty = soak(flight, 60.0 * arguments.minutes)
    left = [space.name for space in Path("/run/netns").glob(f"{PREFIX}*")]
    print(f"left behind: {', '.join(left) or 'nothing'}")
    return 1 if faulty or left else 0


def soak(flight: ChaosFlight, seconds: float) -> bool:
    """Soaks one flight; returns whether anything was wrong."""
    chance = random.Random(8)
    watch = Watch(flight, flight.recorder.clock(), flight.ids)
    flight.recorder.listen(WARM_UP_S)
    before, pids = holdings(flight), {token: process.pid for token, process in flight.processes.items()}
    end_ns = flight.recorder.clock() + round(1e9 * seconds)
    count = 0
    while flight.recorder.clock() < end_ns:
        chance.choice(faults(flight, chance))()
        count += 1
        flight.recorder.until(lambda: flight.recorder.all_in(Mode.FOLLOW), RECOVERY_S)
        flight.recorder.listen(CALM_S)
        flight.recorder.forget(CALM_S)
    after = holdings(flight)
    referee = watch.referee()
    print(f"{count} faults in {seconds / 60.0:.0f} min; {referee}")
    wrong = referee["collisions"] > 0 or referee["fence_exits"] > 0
    for token in sorted(before):
        if flight.processes[token].pid != pids[token]:
            continue
        one, other = before[token], after[token]
        growth = other.rss_mb / one.rss_mb - 1.0
        print(f"{token}: {one.rss_mb:.1f} -> {other.rss_mb:.1f} MB ({growth:+.1%}), {one} -> {other}")
        wrong |= growth >= LARGEST_GROWTH or other.threads > one.threads or other.files > one.files
    return wrong


if __name__ == "__main__":
    sys.exit(main())
