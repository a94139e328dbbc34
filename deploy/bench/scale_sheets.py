"""The tables and the picture of `bench scale`."""

from collections.abc import Sequence
from typing import Any

from deploy.bench.report import Json, Sheet


def punctuality_sheet(records: Sequence[Json]) -> Sheet:
    """Returns how punctual swarms of several sizes were."""
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


def cost_sheet(records: Sequence[Json]) -> Sheet:
    """Returns what one agent cost, beside a bare node."""
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


def reach_sheet(found: Json) -> Sheet:
    """Returns how many are on time, and by how much one more is not."""

    def row(kind: str, reached: int, ratio: str) -> tuple[str, ...]:
        of_kind = {each["n"]: each for each in found["tried"] if each["kind"] == kind}
        above = min((n for n in of_kind if n > reached), default=None)
        last = (
            _shares(of_kind[reached]) if reached else "-",
            "-" if above is None else f"{above}: {_shares(of_kind[above])}",
        )
        return (kind, str(reached), *last, ratio)

    ratio = "-" if found["on_time_ratio"] is None else f"{found['on_time_ratio']:.2f}"
    return Sheet(
        title="Largest swarm of which 99% of the steps are on time, at the rate of the hand",
        columns=("", "number", "on time, samples used", "the next that was tried", "of the bare nodes"),
        rows=(row("agents", found["agents_on_time"], ratio), row("bare nodes", found["bare_on_time"], "")),
    )


def _shares(tried: Json) -> str:
    return f"{tried['on_time']:.1%}, {tried['used']:.1%}"


def draw_scale(figure: Any, records: Sequence[Json]) -> None:
    """Draws punctuality, cost and messages over the number of agents into a `matplotlib` figure."""
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
