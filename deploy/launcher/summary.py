"""What is left of a flight: the JSON contract of `swarmtouch up` and the printed tables."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import attrs
from rich import box
from rich.console import Console
from rich.table import Table

from deploy.launcher.flight import Outcome, exit_word
from deploy.launcher.monitor import Health, Monitor
from deploy.launcher.process_table import GloveChoice
from deploy.verdict import absences, contacts, landing
from observer.agent_log import AgentSummary
from observer.glove_log import GloveLog
from shared.nodes import DRONE

Json = dict[str, Any]

_OUTCOMES = ("played", "delivered", "suppressed", "failed", "lost")


def flight_summary(
    outcome: Outcome, monitor: Monitor, glove: GloveChoice | None = None, remarks: Sequence[str] = ()
) -> Json:
    """Puts the numbers of a flight together.

    Args:
        outcome: How the flight went.
        monitor: What was heard of it.
        glove: What the operator wore.
        remarks: What was left out of a recorded hand, and why.

    Returns:
        The JSON contract: `ok` (no `faults`: no unexpected exit, every drone followed if the hand ever asked
        for it, all landed, and by the referee no collision and no fence exit), `seconds`, `restarts`, its
        `min_distance_m`, `min_hand_distance_m`, `collisions`, `fence_exits` (null without a simulated world),
        `agents` with `id, steps, rate_hz, on_time, hand_used, tracking_rms_m, latency_ms {p50, p99}, cpu,
        rss_mb` each; and beyond the contract `faults` (sentences), `hand` (`asked`: whether it ever asked to
        fly; `rejected`: how many of its poses were impossible; `jumps`; `remarks`), `landed`, `formation`,
        `glove` (null without one: `uri`, `patterns`; `played`, `delivered`, `suppressed`, `failed` and `lost`
        by pattern; `latency_ms` from the drone state to the first frame) and, per agent, `followed`,
        `lateness_ms`, `missed`, `rejected` (by reason) and `restarts`.
    """
    referee = outcome.referee
    formation = attrs.asdict(monitor.stats.formation())
    agents = [_agent(agent, outcome, monitor) for agent in monitor.stats.agents()]
    hand = {
        "asked": monitor.asked,
        "rejected": monitor.rejected_poses,
        "jumps": monitor.hand_jumps,
        "remarks": list(remarks),
    }
    # Who calls a flight off before the hand is there gets what was asked for, and a refusal has its own words.
    heard = outcome.interrupted or bool(outcome.refused) or monitor.stats.hand is not None
    faults = _faults(outcome, {agent["id"]: agent["followed"] for agent in agents}, hand, heard=heard)
    return {
        "ok": not faults,
        "faults": faults,
        "seconds": outcome.seconds,
        "restarts": sum(outcome.restarts.values()),
        "landed": outcome.landed,
        "min_distance_m": referee.get("min_distance_m"),
        "min_hand_distance_m": referee.get("min_hand_distance_m"),
        "collisions": _count(referee, "collisions"),
        "fence_exits": _count(referee, "fence_exits"),
        "hand": hand,
        "agents": agents,
        "formation": formation,
        "glove": _glove(glove, monitor.glove) if glove else None,
    }


def print_summary(summary: Json, console: Console) -> None:
    """Prints the tables that the operator reads after a flight."""
    console.print(_agent_table(summary["agents"]))
    if summary["formation"]["area_m2"]:
        console.print(_formation_table(summary["formation"]))
    if summary["glove"]:
        console.print(_glove_table(summary["glove"]))
    console.print(_flight_table(summary))
    for remark in summary["hand"]["remarks"]:
        console.print(f"hand: {remark}", soft_wrap=True)
    for fault in summary["faults"]:
        console.print(f"not ok: {fault}", soft_wrap=True)


def _faults(outcome: Outcome, followed: Mapping[int, bool], hand: Json, *, heard: bool) -> list[str]:
    exits, failures = outcome.unexpected_exits, outcome.failed_starts
    return [
        *(f"{name} ended unexpectedly ({', '.join(map(exit_word, codes))})" for name, codes in exits.items()),
        *(f"{name} could not be started ({count} times)" for name, count in failures.items()),
        *absences(followed, heard=heard, asked=hand["asked"], rejected=hand["rejected"], early=outcome.early),
        *contacts(outcome.referee),
        *(["what the referee saw is unknown"] if outcome.simulated and not outcome.referee else []),
        *landing(outcome.stopped, landed=outcome.landed),
    ]


def _health(monitor: Monitor, token: str) -> Health:
    return monitor.health.get(token) or Health()


def _count(referee: Mapping[str, float], name: str) -> int | None:
    return int(referee[name]) if name in referee else None


def _agent(agent: AgentSummary, outcome: Outcome, monitor: Monitor) -> Json:
    token = f"{DRONE}/{agent.id}"
    health = _health(monitor, token)
    return {
        "id": agent.id,
        "followed": agent.tracking_rms_m is not None,
        "steps": agent.steps,
        "missed": agent.missed,
        "rate_hz": agent.rate_hz,
        "on_time": agent.on_time,
        "hand_used": agent.hand_used,
        "lateness_ms": agent.lateness_ms._asdict(),
        "tracking_rms_m": agent.tracking_rms_m,
        "latency_ms": agent.latency_ms._asdict(),
        "restarts": outcome.restarts.get(token, 0),
        "rejected": dict(health.rejected),
        "cpu": health.cpu,
        "rss_mb": health.rss_mb,
    }


def _glove(choice: GloveChoice, log: GloveLog) -> Json:
    return {
        "uri": choice.uri,
        "patterns": choice.patterns,
        **{outcome: dict(getattr(log, outcome)) for outcome in _OUTCOMES},
        "latency_ms": log.latency_ms.quantiles()._asdict(),
    }


def _agent_table(agents: Iterable[Json]) -> Table:
    table = _table(
        "agents (times in ms: p50 / p99)",
        *("id", "steps", "Hz", "on time", "lateness", "hand used", "RMS m", "latency", "cpu", "MB"),
    )
    for agent in agents:
        table.add_row(
            str(agent["id"]),
            str(agent["steps"]),
            f"{agent['rate_hz']:.1f}",
            f"{agent['on_time']:.1%}",
            _quantiles(agent["lateness_ms"]),
            f"{agent['hand_used']:.1%}",
            _number(agent["tracking_rms_m"]),
            _quantiles(agent["latency_ms"]),
            f"{agent['cpu']:.0%}",
            f"{agent['rss_mb']:.0f}",
        )
    return table


def _formation_table(formation: Json) -> Table:
    table = _table("formation", "", "mean", "min", "max")
    table.add_row("area, m2", *_spread(formation["area_m2"]))
    for pair, spread in formation["distances_m"].items():
        table.add_row(f"distance {pair}, m", *_spread(spread))
    return table


def _glove_table(glove: Json) -> Table:
    table = _table(f"glove {glove['uri']}, patterns {glove['patterns']}", "pattern", *_OUTCOMES)
    for name in sorted({name for outcome in _OUTCOMES for name in glove[outcome]}):
        table.add_row(name, *(str(glove[outcome].get(name, 0)) for outcome in _OUTCOMES))
    table.caption = f"drone state to first frame, ms (p50 / p99): {_quantiles(glove['latency_ms'])}"
    return table


def _flight_table(summary: Json) -> Table:
    table = _table("flight", "", "")
    table.add_row("the hand asked to fly", "yes" if summary["hand"]["asked"] else "no")
    table.add_row("its poses that were impossible", str(summary["hand"]["rejected"]))
    table.add_row("how often it jumped", str(summary["hand"]["jumps"]))
    table.add_row("smallest distance between drones, m", _number(summary["min_distance_m"]))
    table.add_row("smallest distance to the hand, m", _number(summary["min_hand_distance_m"]))
    table.add_row("collisions", _number(summary["collisions"], 0))
    table.add_row("fence exits", _number(summary["fence_exits"], 0))
    table.add_row("restarts", str(summary["restarts"]))
    table.add_row("landed", "yes" if summary["landed"] else "no")
    return table


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=0, show_header=any(columns))
    for index, column in enumerate(columns):
        table.add_column(column, justify="right" if index else "left", no_wrap=True)
    return table


def _spread(spread: Json) -> tuple[str, ...]:
    return tuple(_number(spread[name]) for name in ("mean", "min", "max"))


def _quantiles(quantiles: Json) -> str:
    return " / ".join(_number(quantiles[name], 1) for name in ("p50", "p99"))


def _number(value: float | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
