"""`bench lockstep`: how much faster than real time the simulators are, in one process on one core.

Small swarms run as real agents, large ones as one flock without messages.
"""

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from agents.settings import hand_settings
from deploy.bench.figures import spread
from deploy.bench.report import INK, Json, Report, Sheet
from deploy.lockstep.central import Flock
from deploy.lockstep.collector import no_collector
from deploy.lockstep.hand_track import map_samples, relayed
from deploy.lockstep.lockstep import Lockstep
from deploy.lockstep.start import rest_places, start_flyers
from shared.config import load_scenario
from shared.formation import Formation, build_formation
from shared.messages import HandSample
from shared.scenario import Scenario

LARGEST_OF_AGENTS = 32
"""Larger swarms run as one flock."""
WARM_UP = 10
"""Ticks that do not count."""
FEWEST = 5
"""Ticks that count at least, however long they take."""
LONGEST_S = 20.0
"""Simulated time at most, s."""


def measure(
    *,
    drones: Sequence[int],
    seconds: float,
    scenario: str = "grid",
    overrides: Sequence[str] = (),
    say: Callable[[str], None] = lambda _: None,
) -> Report:
    """Measures swarms of several sizes.

    Args:
        drones: The sizes.
        seconds: How long each may run, s of real time.
        scenario: What flies; its `formation.n` is set.
        overrides: Further `key=value` items.
        say: Told what is going on.

    Raises:
        ConfigError: The scenario is refused.
    """
    records = []
    for number in drones:
        settings = load_scenario(scenario, (f"formation.n={number}", *overrides))
        formation = build_formation(settings, scenario)
        kind = "agents" if number <= LARGEST_OF_AGENTS else "flock"
        say(f"{number} drones, {kind}")
        samples = relayed("scripted:tour?lead=1", LONGEST_S, settings.rates.control_hz)
        run = _agents if kind == "agents" else _flock
        with no_collector():
            times = _timed(run(settings, formation, samples), seconds)
        records.append(_record(number, kind, times, settings.rates.control_hz))
    return Report(
        name="lockstep",
        records=tuple(records),
        sheets=(_sheet(records),),
        draw=lambda figure: _draw(figure, records),
    )


def _agents(settings: Scenario, formation: Formation, samples: Sequence[HandSample]) -> Iterator[None]:
    ((_, hand),) = map_samples(samples[:1], hand_settings(settings, formation))
    flyers = start_flyers(settings, formation, rest_places(formation, hand), airborne=True)
    swarm = Lockstep(settings, formation, flyers, encoded=False)
    for sample in samples:
        swarm.advance(sample)
        yield


def _flock(settings: Scenario, formation: Formation, samples: Sequence[HandSample]) -> Iterator[None]:
    hands = map_samples(samples, hand_settings(settings, formation))
    flock = Flock(settings, formation, rest_places(formation, hands[0][1]))
    for sample, hand in hands:
        flock.advance(sample, hand)
        yield


def _timed(ticks: Iterator[None], seconds: float) -> list[float]:
    """Returns how long each tick took, s, until the time or the hand is over."""
    for _ in itertools.islice(ticks, WARM_UP):
        pass
    times: list[float] = []
    last = started = time.perf_counter()
    for _ in ticks:
        now = time.perf_counter()
        times.append(now - last)
        last = now
        if now - started > seconds and len(times) >= FEWEST:
            break
    return times


def _record(number: int, kind: str, times: Sequence[float], rate_hz: float) -> Json:
    ticks = spread(times)
    return {
        "drones": number,
        "realtime_factor": len(times) / rate_hz / sum(times),
        "kind": kind,
        "n": ticks.n,
        "tick_ms": {"p10": ticks.p10 * 1e3, "p50": ticks.p50 * 1e3, "p90": ticks.p90 * 1e3},
        "us_per_drone": ticks.p50 * 1e6 / number,
    }


def _sheet(records: Sequence[Json]) -> Sheet:
    return Sheet(
        title="Simulators on one core",
        columns=("drones", "as", "times real time", "tick, ms", "p10 to p90", "us per drone", "n"),
        rows=tuple(
            (
                str(r["drones"]),
                r["kind"],
                f"{r['realtime_factor']:.3g}",
                f"{r['tick_ms']['p50']:.3g}",
                f"{r['tick_ms']['p10']:.3g} to {r['tick_ms']['p90']:.3g}",
                f"{r['us_per_drone']:.3g}",
                str(r["n"]),
            )
            for r in records
        ),
    )


def _draw(figure: Any, records: Sequence[Json]) -> None:
    axes = figure.subplots()
    for kind, marker in (("agents", "o"), ("flock", "s")):
        of_kind = [r for r in records if r["kind"] == kind]
        axes.plot(
            [r["drones"] for r in of_kind], [r["realtime_factor"] for r in of_kind], marker=marker, label=kind
        )
    axes.axhline(1.0, linestyle=":", color=INK)
    axes.set(xscale="log", yscale="log", xlabel="drones", ylabel="times real time")
    axes.legend()
