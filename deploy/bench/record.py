"""`bench record`: whether a flight notices that it is recorded, and what the recording misses.

The same swarm flies with and without a recorder in turns, A B A B. Lateness runs from the arrival of the last
message that is new in a step to the start of that step.
"""

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from attrs import frozen

from deploy.bench.comb import comb
from deploy.bench.figures import TEXT_COLUMNS, Spread, draw_shares, ratio_by_round, spread
from deploy.bench.flight_ear import FlightEar
from deploy.bench.report import Json, Report, Sheet
from deploy.bench.swarm import Phase, fly
from observer.link_stats import SwarmLinks
from observer.trace.read import open_trace
from shared.config import load_scenario
from shared.formation import Formation, build_formation
from shared.nodes import OBSERVER
from shared.scenario import Scenario

NAMES = {False: "not recorded", True: "recorded"}


@frozen(kw_only=True)
class Taken:
    """What a trace holds.

    Attributes:
        messages: How many.
        missing: By key, what a publisher sent between its first and last sample here and is not here.
        dropped: Messages that reached the recorder and that it could not keep.
    """

    messages: int
    missing: dict[str, int]
    dropped: int


@frozen(kw_only=True)
class Turn:
    """One flight: what was heard of it, what it used, and its trace if it was recorded."""

    ear: FlightEar
    phase: Phase
    trace: Taken | None

    def lateness_ms(self) -> list[float]:
        """Returns the lateness of every step of every agent."""
        return [late for hops in self.ear.stats.hops.values() for late in hops.wake]


def measure(
    *,
    agents: int,
    seconds: float,
    rounds: int,
    scenario: str = "grid",
    overrides: Sequence[str] = (),
    say: Callable[[str], None] = lambda _: None,
) -> Report:
    """Measures a swarm with and without a recorder.

    Args:
        agents: How many fly.
        seconds: How long each of the two is measured, all rounds together.
        rounds: How often they take turns.
        scenario: What flies; its formation becomes a comb of that size.
        overrides: Further `key=value` items.
        say: Told what is going on.

    Raises:
        ConfigError: The scenario is refused.
        BenchError: Somebody ended or did not come.
    """
    settings = load_scenario(scenario, (*comb(agents), *overrides))
    formation = build_formation(settings, scenario)
    turns: dict[bool, list[Turn]] = {False: [], True: []}
    for turn in range(rounds):
        for recorded, name in NAMES.items():
            say(f"round {turn + 1} of {rounds}: {name}")
            turns[recorded].append(_take_turn(settings, formation, seconds / rounds, recorded=recorded))
    by_round = {recorded: [turn.lateness_ms() for turn in of] for recorded, of in turns.items()}
    late = {recorded: [value for values in of for value in values] for recorded, of in by_round.items()}
    of = {recorded: spread(values) for recorded, values in late.items()}
    record = _record(agents, turns, of, ratio_by_round(by_round[True], by_round[False]))
    return Report(
        name="record",
        records=(record,),
        sheets=(_lateness_sheet(of, record), _trace_sheet(record)),
        draw=lambda figure: draw_shares(
            figure, {NAMES[on]: values for on, values in late.items()}, "lateness of a step, ms"
        ),
    )


def _take_turn(settings: Scenario, formation: Formation, seconds: float, *, recorded: bool) -> Turn:
    with tempfile.TemporaryDirectory() as folder:
        ear, phase = fly(settings, formation, seconds, recorded_to=Path(folder) if recorded else None)
        return Turn(ear=ear, phase=phase, trace=_read(Path(folder)) if recorded else None)


def _read(folder: Path) -> Taken:
    trace, swarm, number = open_trace(folder), SwarmLinks(), 0
    for record, message in trace.messages():
        swarm.add(record.key, message, record.log_ns)
        number += 1
    missing = {row.key: row.missing for row in swarm.rows() if row.listener == OBSERVER}
    return Taken(messages=number, missing=missing, dropped=trace.dropped)


def _record(agents: int, turns: dict[bool, list[Turn]], of: dict[bool, Spread], ratios: list[float]) -> Json:
    off, on = of[False], of[True]
    traces = [turn.trace for turn in turns[True] if turn.trace]
    recorder = [turn.phase.usage[f"{OBSERVER}/0"].cpu_s / turn.phase.seconds for turn in turns[True]]
    return {
        "agents": agents,
        "seconds": sum(turn.phase.seconds for turn in turns[True]),
        "ready": all(turn.phase.ready for of in turns.values() for turn in of),
        "late_p50_ms": on.p50,
        "late_p99_ms": on.p99,
        "unrecorded_p50_ms": off.p50,
        "unrecorded_p99_ms": off.p99,
        "ratio": on.p50 / off.p50,
        "ratio_p99": on.p99 / off.p99,
        "ratio_by_round": ratios,
        "n": on.n,
        "rate_hz": _rate_hz(turns[True]),
        "unrecorded_rate_hz": _rate_hz(turns[False]),
        "recorder_cores": float(np.mean(recorder)),
        "messages": sum(trace.messages for trace in traces),
        "missing": sum(sum(trace.missing.values()) for trace in traces),
        "missing_worst_link": max(max(trace.missing.values()) for trace in traces),
        "links": max(len(trace.missing) for trace in traces),
        "dropped": sum(trace.dropped for trace in traces),
    }


def _rate_hz(turns: Sequence[Turn]) -> float:
    return float(np.mean([agent.rate_hz for turn in turns for agent in turn.ear.stats.agents()]))


def _lateness_sheet(of: dict[bool, Spread], record: Json) -> Sheet:
    rate = {False: record["unrecorded_rate_hz"], True: record["rate_hz"]}
    ratios = {False: "", True: " ".join(f"{ratio:.2f}" for ratio in record["ratio_by_round"])}
    rows = tuple((name, *of[on].text(3), f"{rate[on]:.1f}", ratios[on]) for on, name in NAMES.items())
    title = f"Lateness of a step of {record['agents']} agents, ms"
    return Sheet(title=title, columns=("", *TEXT_COLUMNS, "steps/s", "times the row above"), rows=rows)


def _trace_sheet(record: Json) -> Sheet:
    row = (
        f"{record['recorder_cores']:.1%}",
        str(record["messages"]),
        str(record["links"]),
        str(record["missing"]),
        str(record["missing_worst_link"]),
        str(record["dropped"]),
    )
    columns = ("core", "messages", "links", "missing", "missing, worst link", "dropped by it")
    return Sheet(title="The recorder", columns=("", *columns), rows=((f"{record['seconds']:.0f} s", *row),))
