"""`bench scale`: many agents on this machine, what each costs against a bare node, and how many are on time.

Real and bare swarms of the same formation take turns. A bare node has the links and subscriptions of an agent
and sends payloads of the same size at the same rate; the vehicle's link it does not have. Then both look, in
turns, for the largest swarm of their kind that is on time at the rate of the hand.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from attrs import asdict, frozen

from deploy.bench.comb import comb
from deploy.bench.figures import spread
from deploy.bench.flight_ear import FlightEar
from deploy.bench.floor_ear import FloorEar
from deploy.bench.reach import LOST, Ladder, Punctuality, climb, of_agents, of_bare
from deploy.bench.report import Json, Report
from deploy.bench.scale_sheets import cost_sheet, draw_scale, punctuality_sheet, reach_sheet
from deploy.bench.swarm import BenchError, Phase, fly, fly_bare_zenoh
from observer.agent_log import AgentSummary
from shared.config import load_scenario
from shared.formation import Formation, build_formation
from shared.nodes import DRONE, neighbours
from shared.scenario import Scenario

AGENTS, BARE = "agents", "bare nodes"


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
    largest: int = 0,
    scenario: str = "grid",
    overrides: Sequence[str] = (),
    say: Callable[[str], None] = lambda _: None,
) -> Report:
    """Measures swarms of several sizes; the first that cannot be measured ends the curve, and is named.

    Args:
        agents: The sizes.
        seconds: How long each swarm is measured, all rounds together.
        rounds: How often real and bare take turns.
        largest: Largest swarm to try when looking for how many are on time; 0: do not look.
        scenario: What flies; its formation becomes a comb of that size.
        overrides: Further `key=value` items.
        say: Told what is going on.

    Raises:
        ConfigError: The scenario is refused.
        BenchError: Somebody ended or did not come, in the first swarm.
    """
    records: list[Json] = []
    sizes: dict[int, int] = {}
    for number in agents:
        settings, formation = _swarm(number, scenario, overrides)
        turns: list[Turn] = []
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
        sizes = turns[-1].ear.payload_bytes
    sheets = [punctuality_sheet(records), cost_sheet(records)]
    found: list[Json] = []
    if largest:
        found = [
            _reach(
                records, sizes, seconds, largest, partial(_swarm, scenario=scenario, overrides=overrides), say
            )
        ]
        sheets.append(reach_sheet(found[0]))
    return Report(
        name="scale",
        records=(*records, *found),
        sheets=tuple(sheets),
        draw=lambda figure: draw_scale(figure, records),
    )


def _swarm(number: int, scenario: str, overrides: Sequence[str]) -> tuple[Scenario, Formation]:
    settings = load_scenario(scenario, (*comb(number), *overrides))
    return settings, build_formation(settings, scenario)


def _reach(
    records: Sequence[Json],
    sizes: Mapping[int, int],
    seconds: float,
    largest: int,
    swarm: Callable[[int], tuple[Scenario, Formation]],
    say: Callable[[str], None],
) -> Json:
    """Looks for the largest swarms that are on time, from what has been measured on."""
    usual = max(size for node, size in sizes.items() if node)
    ladders = {AGENTS: Ladder(largest), BARE: Ladder(largest)}
    tried: list[Json] = []

    def note(kind: str, number: int, punctuality: Punctuality) -> None:
        ladders[kind].tried[number] = punctuality.keeps_up
        tried.append({"kind": kind, "n": number, **asdict(punctuality)})

    def probe(kind: str, number: int) -> None:
        say(f"{number} {kind}: are they on time?")
        settings, formation = swarm(number)
        try:
            if kind == AGENTS:
                flight, phase = fly(settings, formation, seconds)
                punctuality = of_agents(flight.stats.agents(), settings.rates.control_hz)
            else:
                payloads = {0: sizes[0], **dict.fromkeys(formation.ids, usual)}
                ear, phase = fly_bare_zenoh(settings, formation, payloads, seconds)
                punctuality = of_bare(list(ear.answers.values()), settings.rates.hand_hz)
        except BenchError as error:
            say(f"{number} {kind}: {error}")
            note(kind, number, LOST)
        else:
            note(kind, number, punctuality if phase.ready else LOST)

    for record in records:
        note(AGENTS, record["agents"], Punctuality(**record["punctuality"]))
        note(BARE, record["agents"], Punctuality(**record["bare_punctuality"]))
    climb(ladders, probe)
    agents, bare = (ladders[kind].reached for kind in (AGENTS, BARE))
    return {
        "agents_on_time": agents,
        "bare_on_time": bare,
        "on_time_ratio": agents / bare if bare else None,
        "largest": largest,
        "tried": tried,
    }


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
    punctuality = of_agents(summaries, settings.rates.control_hz)
    answers = [tokens for turn in turns for tokens in turn.ear.answers.values()]
    agent = _per_drone([turn.real for turn in turns])
    bare = _per_drone([turn.bare for turn in turns])
    last = formation.ids[formation.levels[-1][-1]]
    latencies = [value for turn in turns for value in turn.flight.stats.latencies_ms[last]]
    sent_bare = sum(len(values) for turn in turns for values in turn.ear.latencies_ms.values())
    return {
        "agents": len(formation.ids),
        "seconds": seconds,
        "on_time": punctuality.on_time,
        "rate_hz": sum(s.rate_hz for s in summaries) / len(summaries),
        "cpu_cores": _cores([turn.real for turn in turns]),
        "cpu_per_agent_ratio": agent["cpu"] / bare["cpu"] if bare["cpu"] else None,
        "rss_mb": agent["rss_mb"],
        "on_time_worst": min(s.on_time for s in summaries),
        "hand_used": punctuality.used,
        "hand_used_worst": min(s.hand_used for s in summaries),
        "ready": all(turn.real.ready for turn in turns),
        "latency_p50_ms": spread(latencies).p50 if latencies else None,
        "heard_per_s": _heard_per_s(settings, formation, summaries),
        "cpu_per_agent": agent["cpu"],
        "wakeups_per_s": agent["wakeups_per_s"],
        "bare_cpu_per_node": bare["cpu"],
        "bare_wakeups_per_s": bare["wakeups_per_s"],
        "punctuality": asdict(punctuality),
        "bare_punctuality": asdict(of_bare(answers, settings.rates.hand_hz)),
        "bare_rate_hz": sent_bare / len(formation.ids) / sum(turn.bare.seconds for turn in turns),
        "cpu_ratio_by_round": [
            _per_drone([turn.real])["cpu"] / cpu for turn in turns if (cpu := _per_drone([turn.bare])["cpu"])
        ],
    }


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
