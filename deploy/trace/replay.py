"""`swarmtouch trace replay`: say again what was recorded."""

from collections.abc import Sequence
from pathlib import Path

from observer.trace.read import Trace, open_trace
from observer.trace.replay import PREFIX, replay
from shared.bus import ZenohBus
from shared.clock import system_clock
from shared.errors import ConfigError
from shared.formation import build_formation
from shared.net.settings import peer_settings
from shared.nodes import RELAY, endpoint
from shared.process import prepare_process
from shared.topics import matches

_NAMED = 20
"""Of more keys only so many are named."""


def main(*, run: Path, speed: float, keys: Sequence[str], as_live: bool, delay: float) -> int:
    """Replays to the end, or until Ctrl-C; returns the exit code, 1 if there was nothing to say."""
    trace = open_trace(run)
    stopping, clock = prepare_process("replay"), system_clock()
    # In the relay's place everybody hears it; and beside a flying relay it cannot start, so that a hand of
    # the past never competes with a living one.
    listen = endpoint(trace.scenario, build_formation(trace.scenario), RELAY)
    prefix = "" if as_live else PREFIX
    _check_keys(trace, keys)
    chosen = (r for r in trace.records() if not keys or any(matches(key, r.key) for key in keys))
    with ZenohBus(peer_settings(trace.scenario.swarm.name, listen)) as bus:
        print(f"replaying {run} as {prefix}... at {listen} in {delay:g} s", flush=True)
        stopping.wait(delay)
        done = replay(chosen, bus, clock, stopping, speed=speed, prefix=prefix)
    late = done.lateness_ms
    print(f"{done.messages} messages", end="")
    print(f", late by {late.p50:.2f} ms (median), {late.p99:.2f} ms (p99)" if late.p50 and late.p99 else "")
    if done.left_out:
        print(f"{run}: {done.left_out} payloads came on keys that are none of a swarm's and were left out")
    for fault in trace.faults:
        print(f"{run}: {fault}")
    return 0 if done.messages else 1


def _check_keys(trace: Trace, keys: Sequence[str]) -> None:
    """Looks whether there is anything to say on each of some keys.

    Raises:
        ConfigError: There is not.
    """
    silent, said = list(keys), set[str]()
    for record in trace.records():
        if not silent:
            return
        if record.key not in said:
            said.add(record.key)
            silent = [key for key in silent if not matches(key, record.key)]
    if silent:
        known = ", ".join(sorted(said)[:_NAMED]) or "nothing"
        raise ConfigError(f"--keys {silent[0]}: nothing was said there; the trace has {known}")
