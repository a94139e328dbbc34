"""`bench chain`: from the hand to the set-point of the last drone, against two floors in the same run.

Three swarms of the same shape take turns, A B C A B C: real agents in a simulated flight, bare nodes over
Zenoh with the same links, subscriptions and payload sizes, and bare nodes over UDP sockets. Where the law is
compiled, agents of its pure form take turns with them, and with keys (profile `field`) the same agents without
keys; the floors never have any. A latency runs from the stamp of a hand sample to the stamp of the first
set-point that contains it through every hop.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from attrs import evolve

from deploy.bench.figures import TEXT_COLUMNS, Spread, draw_shares, ratio_by_round, spread
from deploy.bench.flight_ear import HopTimes
from deploy.bench.profile import FIELD, in_profile, plain, signature_cost
from deploy.bench.report import Json, Report, Sheet
from deploy.bench.swarm import BenchError, Edit, fly, fly_bare_udp, fly_bare_zenoh
from deploy.launcher.process_table import ProcessRow
from shared.compiled import PURE, form
from shared.config import load_scenario
from shared.formation import build_formation
from shared.scenario import Scenario

NAMES = {
    "pure": "agents, pure form",
    "real": "agents",
    "plain": "agents without keys",
    "zenoh": "bare nodes, Zenoh",
    "udp": "bare nodes, UDP sockets",
}
HOP_PARTS = ("transport", "wake", "step")


def measure(
    *,
    scenario: str = "rhombus",
    seconds: float,
    rounds: int,
    profile: str | None = None,
    overrides: Sequence[str] = (),
    edit: Edit = lambda row: row,
    say: Callable[[str], None] = lambda _: None,
) -> Report:
    """Measures the chain.

    Args:
        scenario: Whose chain; the latency is that of its deepest drone.
        seconds: How long each swarm is measured, all rounds together.
        rounds: How often they take turns.
        profile: `laptop` or `field` (with keys for this run only); None for the scenario's own.
        overrides: `key=value` items for the scenario.
        edit: Changes rows of the process table of the real swarm.
        say: Told what is going on.

    Raises:
        ConfigError: The scenario is refused.
        BenchError: Somebody ended, or nothing came through.
    """
    loaded = load_scenario(scenario, overrides)
    formation = build_formation(loaded, scenario)
    last = formation.ids[formation.levels[-1][-1]]
    floor = plain(loaded)
    sizes: dict[int, int] = {}
    with in_profile(loaded, formation, profile) as settings:
        flown: dict[str, tuple[Scenario, Edit]] = {"real": (settings, edit)}
        if form().digest:
            flown["pure"] = (settings, lambda row: in_pure_form(edit(row)))
        if settings.net.keys:
            flown["plain"] = (floor, edit)
        taken: dict[str, list[list[float]]] = {
            name: [] for name in NAMES if name in flown or name in ("zenoh", "udp")
        }
        hops: dict[str, list[dict[int, HopTimes]]] = {name: [] for name in flown}
        for turn in range(rounds):
            for name, (flying, change) in flown.items():
                say(f"round {turn + 1} of {rounds}: {NAMES[name]}, {flying.net.profile}")
                flight, _ = fly(flying, formation, seconds / rounds, edit=change)
                taken[name].append(flight.stats.latencies_ms[last])
                hops[name].append(flight.stats.hops)
                # Those of the first: with keys, and so a signature, if there are any.
                sizes = sizes or flight.payload_bytes()
            for name, fly_bare in (("zenoh", fly_bare_zenoh), ("udp", fly_bare_udp)):
                say(f"round {turn + 1} of {rounds}: {NAMES[name]}")
                ear, _ = fly_bare(floor, formation, sizes, seconds / rounds)
                taken[name].append(ear.latencies_ms[last])
                if ear.payload_bytes != sizes:
                    raise BenchError(f"{NAMES[name]} sent {ear.payload_bytes} bytes instead of {sizes}")
        cost = signature_cost(settings.net)
    for name, turns in taken.items():
        if not all(turns):
            raise BenchError(f"{NAMES[name]}: no hand sample came through to drone {last}; measure longer")
    medians = {name: _hop_medians(turns) for name, turns in hops.items()}
    return _report(settings.net.profile, taken, medians, sizes, cost)


def in_pure_form(row: ProcessRow) -> ProcessRow:
    """Has a process run the law in its pure form."""
    return evolve(row, command=("/usr/bin/env", f"{PURE}=1", *row.command))


def _report(
    profile: str,
    taken: dict[str, list[list[float]]],
    hops: dict[str, dict[int, Json]],
    sizes: dict[int, int],
    cost: Json,
) -> Report:
    pooled = {name: [value for turn in turns for value in turn] for name, turns in taken.items()}
    of = {name: spread(values) for name, values in pooled.items()}
    below = dict(pairwise(taken))
    ratios = {name: ratio_by_round(taken[name], taken[other]) for name, other in below.items()}
    record = {
        "profile": profile,
        "p50_ms": of["real"].p50,
        "p99_ms": of["real"].p99,
        "floor_p50_ms": of["zenoh"].p50,
        "udp_p50_ms": of["udp"].p50,
        "ratio": of["real"].p50 / of["zenoh"].p50,
        "n": of["real"].n,
        "floor_p99_ms": of["zenoh"].p99,
        "udp_p99_ms": of["udp"].p99,
        "floor_ratio": of["zenoh"].p50 / of["udp"].p50,
        "ratio_by_round": ratio_by_round(taken["real"], taken["zenoh"]),
        "floor_ratio_by_round": ratios["zenoh"],
        "floor_n": of["zenoh"].n,
        "udp_n": of["udp"].n,
        "payload_bytes": {str(node): size for node, size in sorted(sizes.items())},
        "hops": hops["real"],
        **cost,
    }
    if "pure" in of:
        record |= {"pure_p50_ms": of["pure"].p50, "pure_p99_ms": of["pure"].p99, "pure_n": of["pure"].n}
        record |= {"pure_ratio": of["pure"].p50 / of["zenoh"].p50, "pure_hops": hops["pure"]}
        record |= {"pure_ratio_by_round": ratio_by_round(taken["pure"], taken["zenoh"])}
    if "plain" in of:
        record |= {"plain_p50_ms": of["plain"].p50, "plain_p99_ms": of["plain"].p99, "plain_n": of["plain"].n}
        record |= {"profile_ratio_by_round": ratios["real"]}
    return Report(
        name="chain-field" if profile == FIELD else "chain",
        records=(record,),
        sheets=(
            _latency_sheet(of, ratios),
            *(_hop_sheet(NAMES[name], hops[name]) for name in ("real", "pure") if name in hops),
        ),
        draw=lambda figure: draw_shares(
            figure,
            {NAMES[name]: values for name, values in pooled.items()},
            "latency from the hand to the last drone's set-point, ms",
        ),
    )


def _hop_medians(turns: Sequence[dict[int, HopTimes]]) -> dict[int, Json]:
    def median(drone: int, part: str) -> float:
        values = [value for hops in turns for value in getattr(hops[drone], part)]
        return float(np.median(values)) if values else 0.0

    return {drone: {f"{part}_ms": median(drone, part) for part in HOP_PARTS} for drone in turns[0]}


def _latency_sheet(of: dict[str, Spread], ratios: dict[str, list[float]]) -> Sheet:
    def row(name: str) -> tuple[str, ...]:
        ratio = f"{min(ratios[name]):.2f} to {max(ratios[name]):.2f}" if name in ratios else ""
        return (NAMES[name], *of[name].text(), ratio)

    return Sheet(
        title="Hand to the last drone's set-point, ms",
        columns=("", *TEXT_COLUMNS, "times the row below, by round"),
        rows=tuple(map(row, of)),
    )


def _hop_sheet(name: str, hops: dict[int, Json]) -> Sheet:
    rows = (
        (f"drone {drone}", *(f"{times[f'{part}_ms']:.2f}" for part in HOP_PARTS))
        for drone, times in hops.items()
    )
    return Sheet(
        title=f"Of that, {name}: medians from the last input of a step on, ms",
        columns=("", "encoding and transport", "decoding and waiting", "pose and step"),
        rows=tuple(rows),
    )
