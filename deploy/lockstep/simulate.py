"""From what the user asked for to a simulated run and its summary."""

import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from attrs import frozen

from agents.vehicles.world.setup import referee_rules
from deploy.launcher.process_table import hint_overrides
from deploy.lockstep.central import fly_central
from deploy.lockstep.collector import no_collector
from deploy.lockstep.hand_track import relayed
from deploy.lockstep.lockstep import fly_lockstep
from deploy.lockstep.picture import draw
from deploy.lockstep.record import Record, judge, tracking_rms, write_csv
from deploy.verdict import absences, contacts
from human_relay.sources import plays_by_itself, source_hints, source_remarks
from shared.compiled import form
from shared.errors import ConfigError
from shared.files import writing
from shared.messages import HandSample, Wish
from shared.scenario import Scenario
from shared.scenario_check.check import open_scenario

CENTRAL = "central"
"""One computer for all drones, instead of one agent per drone."""


@frozen(kw_only=True)
class Options:
    """What the user asks for.

    Attributes:
        scenario: Name or file.
        hand: URI of the hand source.
        seconds: Longest flight, s.
        law: `paper`, `stable`, `central` or None for the scenario's own.
        overrides: `key=value` items for the scenario.
        csv: Where to write the ticks.
        plot: Where to draw the top view.
    """

    scenario: str
    hand: str
    seconds: float
    law: str | None
    overrides: tuple[str, ...]
    csv: Path | None
    plot: Path | None


def simulate(options: Options) -> dict[str, Any]:
    """Simulates one flight from a hover in the rest formation.

    Returns:
        The summary: ok, faults (sentences), drones, followed (how many ever did), asked (whether the hand ever
        wished that they fly), without_hand (samples without a possible pose), seconds, realtime_factor, the
        referee's distances and counts, tracking_rms_m, remarks (what was left out of the hand, and why, and
        how often it jumped).

    Raises:
        ConfigError: The scenario or the hand is refused, or a plot cannot be made.
    """
    if not plays_by_itself(options.hand):
        raise ConfigError(f"{options.hand}: nobody points in a simulation; fly it with swarmtouch up")
    law = [f"swarm.law={options.law}"] if options.law not in (None, CENTRAL) else []
    hints = hint_overrides(source_hints(options.hand))
    scenario, formation = open_scenario(options.scenario, (*hints, *law, *options.overrides), network=False)
    rates = scenario.rates
    samples = relayed(options.hand, options.seconds, rates.control_hz, rates.hand_hz)
    started = time.perf_counter()
    fly = fly_central if options.law == CENTRAL else fly_lockstep
    with no_collector():
        record = fly(scenario, formation, samples)
    took_s = time.perf_counter() - started
    if options.csv:
        with writing(options.csv):
            write_csv(record, options.csv)
    if options.plot:
        draw(record, scenario, options.plot)
    remarks = [*source_remarks(options.hand), *_jumped(samples)]
    return {**_summary(record, scenario, samples, took_s), "remarks": remarks}


def _jumped(samples: Sequence[HandSample]) -> list[str]:
    jumps = sum(after.jumped and not before.jumped for before, after in pairwise(samples))
    times = "once" if jumps == 1 else f"{jumps} times"
    return [f"the hand jumped {times}, further than a hand can: it held, and was walked to"] if jumps else []


def _summary(
    record: Record, scenario: Scenario, samples: Sequence[HandSample], took_s: float
) -> dict[str, Any]:
    ids = record.formation.ids
    verdict = judge(record, referee_rules(scenario, record.formation, ids))
    seconds = len(record.hand.t) / scenario.rates.control_hz
    followed = {drone: drone in record.followed for drone in ids}
    asked = any(sample.mode is Wish.FLY for sample in samples)
    without = sum(sample.mode is Wish.HOLD for sample in samples)
    faults = [*absences(followed, heard=True, asked=asked, rejected=without), *contacts(verdict)]
    return {
        "ok": not faults,
        "faults": faults,
        "drones": len(ids),
        "followed": sum(followed.values()),
        "asked": asked,
        "without_hand": without,
        "seconds": seconds,
        "realtime_factor": seconds / took_s,
        "form": str(form()),
        "min_distance_m": verdict.get("min_distance_m"),
        "min_hand_distance_m": verdict.get("min_hand_distance_m"),
        "collisions": verdict["collisions"],
        "fence_exits": verdict["fence_exits"],
        "tracking_rms_m": float(tracking_rms(record).mean()),
    }
