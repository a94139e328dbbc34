"""`bench scale`: many agents on this machine, and what each of them costs against a bare node.

Real and bare swarms of the same formation take turns. A bare node has the links and subscriptions of an agent
and sends payloads of the same size at the same rate; the vehicle's link it does not have.
"""

from collections.abc import Callable, Sequence
from typing import Any

from attrs import frozen

from deploy.bench.comb import comb
from deploy.bench.figures import spread
from deploy.bench.flight_ear import FlightEar
from deploy.bench.floor_ear import FloorEar
from deploy.bench.report import Json, Report, Sheet
from deploy.bench.swarm import BenchError, Phase, fly, fly_bare_zenoh
from observer.agent_log import AgentSummary
from shared.config import load_scenario
from shared.formation import Formation, build_formation
from shared.nodes import DRONE, neighbours
from shared.scenario import Scenario


@frozen(kw_only=True)
class Turn:
    """One round of one size: the real swarm and the bare one."""

    flight: FlightEar
    real: Phase
    ear: FloorEar
    bare: Phase


def measure(
    *,
    agents: Sequence[int],
    seconds: float,
    rounds: int,
    scenario: str = "grid",
    overrides: Sequence[str] = (),
    say: Callable[[str], None] = lambda _: None,
) -> Report:
    """Measures swarms of several sizes; the first that cannot be measured ends the curve, and is named.

    Args:
        agents: The sizes.
        seconds: How long each swarm is measured, all rounds together.
        rounds: How often real and bare take turns.
        scenario: What flies; its formation becomes a comb of that size.
        overrides: Further `key=value` items.
        say: Told what is going on.

    Raises:
        ConfigError: The scenario is refused.
        BenchError: Somebody ended or did not come, in the first swarm.
    """
    records: list[Json] = []
    for number in agents:
        settings = load_scenario(scenario, (*comb(number), *overrides))
        formation = build_formation(settings, scenario)
        turns = []
        try:
            for turn in range(rounds):
                say(f"{number} agents, round {turn + 1} of {rounds}")
                turns.append(_take_turn(settings, formation, seconds / rounds))
        except BenchError as error:
            if not records:
                raise
            say(f"{number} agents: {error}; the curve ends before them")
            break
        records.append(_record(settings, formation, turns))
    return Report(
        name="scale",
        records=tuple(records),
        sheets=(_punctuality(records), _cost(records)),
        draw=lambda figure: _draw(figure, records),
    )


def _take_turn(settings: Scenario, formation: Formation, seconds: float) -> Turn:
    flight, real = fly(settings, formation, seconds)
    sizes = flight.payload_bytes()
    # A drone that is not heard yet would send as much as the others.
    usual = max(sizes.values(), default=0)
    ear, bare = fly_bare_zenoh(
        settings, formation, {node: sizes.get(node, usual) for node in (0, *formation.ids)}, seconds
    )
    return Turn(flight=flight, real=real, ear=ear, bare=bare)


def _record(settings: Scenario, formation: Formation, turns: Sequence[Turn]) -> Json:
    summaries = [summary for turn in turns for summary in turn.flight.stats.agents()]
    seconds = sum(turn.real.seconds for turn in turns)
    agent = _per_drone([turn.real for turn in turns])
    bare = _per_drone([turn.bare for turn in turns])
    last = formation.ids[formation.levels[-1][-1]]
    latencies = [value for turn in turns for value in turn.flight.stats.latencies_ms[last]]
    sent_bare = sum(len(values) for turn in turns for values in turn.ear.latencies_ms.values())
    return {
        "agents": len(formation.ids),
        "seconds": seconds,
        "on_time": _on_time(summaries),
        "rate_hz": sum(s.rate_hz for s in summaries) / len(summaries),
        "cpu_cores": _cores([turn.real for turn in turns]),
        "cpu_per_agent_ratio": agent["cpu"] / bare["cpu"] if bare["cpu"] else None,
        "rss_mb": agent["rss_mb"],
        "on_time_worst": min(s.on_time for s in summaries),
        "hand_used": sum(s.hand_used for s in summaries) / len(summaries),
        "hand_used_worst": min(s.hand_used for s in summaries),
        "ready": all(turn.real.ready for turn in turns),
        "latency_p50_ms": spread(latencies).p50 if latencies else None,
        "heard_per_s": _heard_per_s(settings, formation, summaries),
        "cpu_per_agent": agent["cpu"],
        "wakeups_per_s": agent["wakeups_per_s"],
        "bare_cpu_per_node": bare["cpu"],
        "bare_wakeups_per_s": bare["wakeups_per_s"],
        "bare_rate_hz": sent_bare / len(formation.ids) / sum(turn.bare.seconds for turn in turns),
        "cpu_ratio_by_round": [
            _per_drone([turn.real])["cpu"] / cpu for turn in turns if (cpu := _per_drone([turn.bare])["cpu"])
        ],
    }


def _on_time(summaries: Sequence[AgentSummary]) -> float:
    """Returns the fraction of all steps of all agents that were on time."""
    received = [s.steps - s.missed for s in summaries]
    return sum(s.on_time * n for s, n in zip(summaries, received, strict=True)) / max(sum(received), 1)


def _heard_per_s(settings: Scenario, formation: Formation, summaries: Sequence[AgentSummary]) -> float:
    """Returns how many messages an agent hears per second, on average."""
    rates: dict[int, list[float]] = {drone: [] for drone in formation.ids}
    for summary in summaries:
        rates[summary.id].append(summary.rate_hz)
    rate = {drone: sum(values) / len(values) for drone, values in rates.items()}
    heard = sum(rate[other] for drone in formation.ids for other in neighbours(settings, formation, drone))
    return settings.rates.hand_hz + heard / len(formation.ids)


def _per_drone(phases: Sequence[Phase]) -> Json:
    """Returns means over drones and time: cores, wake-ups per second; and the largest memory, MB."""
    used = [
        (usage, phase) for phase in phases for token, usage in phase.usage.items() if token.startswith(DRONE)
    ]
    return {
        "cpu": sum(usage.cpu_s / phase.seconds for usage, phase in used) / len(used),
        "wakeups_per_s": sum(usage.wakeups / phase.seconds for usage, phase in used) / len(used),
        "rss_mb": max(usage.rss_mb for usage, _ in used),
    }


def _cores(phases: Sequence[Phase]) -> float:
    """Returns how many cores the whole swarm used: agents, relay and world."""
    return sum(usage.cpu_s for phase in phases for usage in phase.usage.values()) / sum(
        p.seconds for p in phases
    )


def _punctuality(records: Sequence[Json]) -> Sheet:
    return Sheet(
        title="Punctuality by number of agents (worst agent in brackets)",
        columns=("agents", "seconds", "Hz", "on time", "hand samples used", "latency p50, ms", "cores"),
        rows=tuple(
            (
                str(r["agents"]),
                f"{r['seconds']:.0f}",
                f"{r['rate_hz']:.1f}",
                f"{r['on_time']:.1%} ({r['on_time_worst']:.1%})",
                f"{r['hand_used']:.1%} ({r['hand_used_worst']:.1%})",
                "-" if r["latency_p50_ms"] is None else f"{r['latency_p50_ms']:.1f}",
                f"{r['cpu_cores']:.2f}",
            )
            for r in records
        ),
    )


def _cost(records: Sequence[Json]) -> Sheet:
    return Sheet(
        title="Cost of one agent; a bare node hears and sends the same",
        columns=("agents", "heard/s", "core", "bare", "ratio", "by round", "wake-ups/s", "bare", "MB"),
        rows=tuple(
            (
                str(r["agents"]),
                f"{r['heard_per_s']:.0f}",
                f"{r['cpu_per_agent']:.1%}",
                f"{r['bare_cpu_per_node']:.1%}",
                "-" if r["cpu_per_agent_ratio"] is None else f"{r['cpu_per_agent_ratio']:.2f}",
                " ".join(f"{ratio:.2f}" for ratio in r["cpu_ratio_by_round"]),
                f"{r['wakeups_per_s']:.0f}",
                f"{r['bare_wakeups_per_s']:.0f}",
                f"{r['rss_mb']:.0f}",
            )
            for r in records
        ),
    )


def _draw(figure: Any, records: Sequence[Json]) -> None:
    left, middle, right = figure.subplots(1, 3)
    number = [r["agents"] for r in records]
    left.plot(number, [100.0 * r["on_time"] for r in records], marker="o", label="on time")
    left.plot(number, [100.0 * r["hand_used"] for r in records], marker="s", label="hand samples used")
    left.set(xlabel="agents", ylabel="share, %", ylim=(0.0, 105.0))
    middle.plot(number, [100.0 * r["cpu_per_agent"] for r in records], marker="o", label="agent")
    middle.plot(number, [100.0 * r["bare_cpu_per_node"] for r in records], marker="s", label="bare node")
    middle.set(xlabel="agents", ylabel="one process, % of a core", ylim=(0.0, None))
    right.plot(number, [r["heard_per_s"] for r in records], marker="o", label="messages heard")
    right.plot(number, [r["wakeups_per_s"] for r in records], marker="s", label="wake-ups")
    right.set(xlabel="agents", ylabel="per agent and second", ylim=(0.0, None))
    for axes in (left, middle, right):
        axes.legend()
