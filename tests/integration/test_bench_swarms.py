"""The bench with real processes: it measures what is there. Nothing here asks whether a machine is fast."""

import math
import sys
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

import pytest
from attrs import evolve

from deploy.bench import chain, record, scale, start
from deploy.bench.figures import spread
from deploy.bench.hop import HAND_ID
from deploy.bench.swarm import BenchError, fly, fly_bare_udp, fly_bare_zenoh
from deploy.launcher.process_table import ProcessRow
from shared.compiled import form
from shared.config import load_scenario
from shared.formation import Formation, build_formation
from shared.scenario import Scenario
from shared.signature import SIGNATURE_BYTES

pytestmark = [
    pytest.mark.timeout(120),
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc"),
]

SLOW_AGENT = Path(__file__).parent.parent / "slow_agent.py"
QUICK_TAKEOFF = "limits.takeoff_height=0.3"
RHOMBUS = load_scenario("rhombus", [QUICK_TAKEOFF])
FORMATION = build_formation(RHOMBUS)
SIZES = {HAND_ID: 100, 1: 201, 2: 302, 3: 403, 4: 504}


def numbers(tree: Any) -> Iterator[float]:
    if isinstance(tree, dict | list):
        for branch in tree.values() if isinstance(tree, dict) else tree:
            yield from numbers(branch)
    elif not isinstance(tree, str):
        yield tree


def slowed(token: str, milliseconds: float) -> Any:
    def edit(row: ProcessRow) -> ProcessRow:
        if row.token != token:
            return row
        python, option, _, _, *arguments = row.command
        return evolve(row, command=(python, option, str(SLOW_AGENT), str(milliseconds), *arguments))

    return edit


def test_two_milliseconds_in_one_agents_step_show_up_as_two_milliseconds() -> None:
    # Drones 2 and 3 do the same at the same time, so load on the machine meets both alike.
    ear, phase = fly(RHOMBUS, FORMATION, 3.0, edit=slowed("drone/2", 2.0))
    assert phase.ready
    step = {drone: median(times.step) for drone, times in ear.stats.hops.items()}
    # A busy machine may wake it later, never earlier.
    assert step[2] - step[3] > 1.5
    # Of the latencies the quickest tenth: the others may have waited for the processor.
    latency = {drone: spread(values).p10 for drone, values in ear.stats.latencies_ms.items()}
    assert latency[2] - latency[3] > 1.5
    assert latency[2] > latency[1]


@pytest.mark.parametrize("fly_bare", [fly_bare_zenoh, fly_bare_udp])
def test_the_floors_pass_payloads_of_the_same_size_through_every_hop(fly_bare: Any) -> None:
    ear, phase = fly_bare(RHOMBUS, FORMATION, SIZES, 1.0)
    assert phase.ready
    assert ear.payload_bytes == SIZES
    assert set(phase.usage) == {"relay/0", "drone/1", "drone/2", "drone/3", "drone/4"}
    assert all(len(values) > 20 for values in ear.latencies_ms.values())
    # One hop more is never faster.
    one, two, _, four = (median(values) for values in ear.latencies_ms.values())
    assert 0.0 < one < two < four


def test_chain_keeps_its_contract() -> None:
    report = chain.measure(seconds=1.5, rounds=1, overrides=[QUICK_TAKEOFF])
    (record,) = report.records
    assert {"p50_ms", "p99_ms", "floor_p50_ms", "udp_p50_ms", "ratio", "n"} <= set(record)
    assert all(math.isfinite(number) for number in numbers(record))
    assert record["ratio"] == pytest.approx(record["p50_ms"] / record["floor_p50_ms"])
    assert record["udp_p50_ms"] > 0.0
    assert record["p50_ms"] <= record["p99_ms"]
    assert min(record["n"], record["floor_n"], record["udp_n"]) > 20
    assert set(record["hops"]) == {1, 2, 3, 4}
    # Where there is a compiled form, both have flown, and where the time of each went is told.
    assert ("pure_p50_ms" in record) == bool(form().digest)
    assert len(report.sheets) == 2 + bool(form().digest)
    assert {len(record[name]) for name in record if name.endswith("hops")} == {4}


def test_chain_with_keys_says_what_they_cost_and_keeps_none() -> None:
    report = chain.measure(seconds=1.5, rounds=1, profile="field", overrides=[QUICK_TAKEOFF])
    (record,) = report.records
    assert report.name == "chain-field"
    assert record["profile"] == "field"
    assert all(math.isfinite(number) for number in numbers(record))
    assert min(record["n"], record["plain_n"], record["floor_n"], record["udp_n"]) > 20
    assert record["profile_ratio_by_round"] == [pytest.approx(record["p50_ms"] / record["plain_p50_ms"])]
    assert record["payload_bytes"]["0"] > SIGNATURE_BYTES
    assert record["sign_us"] > 0.0
    assert record["verify_us"] > 0.0


def test_scale_keeps_its_contract_and_what_it_measured_before_a_size_that_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fly_up_to_three(scenario: Scenario, formation: Formation, seconds: float) -> Any:
        if len(formation.ids) > 3:
            raise BenchError("not everybody was there")
        return fly(scenario, formation, seconds)

    monkeypatch.setattr(scale, "fly", fly_up_to_three)
    said: list[str] = []
    report = scale.measure(
        agents=[3, 4, 5], seconds=1.5, rounds=1, largest=4, overrides=[QUICK_TAKEOFF], say=said.append
    )
    assert "4 agents: not everybody was there; the curve ends before them" in said
    record, found = report.records
    # Whether three are on time is not asked here; four agents never come together, bare nodes may.
    assert found["agents_on_time"] <= 3
    assert found["bare_on_time"] <= 4
    assert {each["kind"] for each in found["tried"]} == {"agents", "bare nodes"}
    assert all(math.isfinite(each[part]) for each in found["tried"] for part in ("on_time", "used", "rate"))
    assert len(report.sheets) == 3
    assert {
        *("agents", "seconds", "on_time", "rate_hz", "cpu_cores", "cpu_per_agent_ratio", "rss_mb"),
    } <= set(record)
    assert all(math.isfinite(number) for number in numbers(record))
    assert (record["agents"], record["ready"]) == (3, True)
    assert record["seconds"] >= 1.5
    assert 0.0 < record["on_time_worst"] <= record["on_time"] <= 1.0
    assert record["cpu_cores"] > 3 * record["cpu_per_agent"] > 0.0
    assert record["rss_mb"] > 10.0
    with pytest.raises(BenchError):
        scale.measure(agents=[4, 3], seconds=1.5, rounds=1)


def test_record_keeps_its_contract_and_reads_its_trace() -> None:
    report = record.measure(agents=2, seconds=1.5, rounds=1, overrides=[QUICK_TAKEOFF])
    (measured,) = report.records
    assert all(math.isfinite(number) for number in numbers(measured))
    assert (measured["agents"], measured["ready"]) == (2, True)
    assert measured["ratio"] == pytest.approx(measured["late_p50_ms"] / measured["unrecorded_p50_ms"])
    # The hand, two agents and every status; 1.5 s of it were measured, more was recorded.
    assert measured["messages"] > 3 * 60
    assert measured["links"] >= 3
    assert 0.0 < measured["recorder_cores"] < 1.0


def test_start_keeps_its_contract() -> None:
    report = start.measure(n=1, warm_up=0, overrides=[QUICK_TAKEOFF])
    (record,) = report.records
    assert {"p50_s", "n"} <= set(record)
    assert record["n"] == 1
    assert record["p50_s"] == pytest.approx(sum(record[part] for part in start.PARTS))
    assert all(record[part] > 0.0 for part in (*start.PARTS, "imports_s"))


def test_a_process_that_ends_spoils_the_measurement() -> None:
    def edit(row: ProcessRow) -> ProcessRow:
        failing = (sys.executable, "-c", "raise SystemExit('out of order')")
        return evolve(row, command=failing) if row.name == "drone-3" else row

    with pytest.raises(BenchError, match="drone-3 ended: out of order"):
        fly(RHOMBUS, FORMATION, 1.0, edit=edit)
