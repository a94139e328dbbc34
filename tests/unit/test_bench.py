"""The bench without processes: what it counts, what it writes, and that a slower part shows up as slower."""

import json
import math
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from agents.agent import Agent
from deploy.bench import lockstep, step
from deploy.bench.figures import spread
from deploy.bench.flight_ear import DetailedStats
from deploy.bench.floor_rows import udp_rows, zenoh_rows
from deploy.bench.hop import HAND_ID, Hop, Token, pack, unpack
from deploy.bench.machine import Conditions
from deploy.bench.plot import check_plot, save_plot
from deploy.bench.profile import in_profile, plain, signature_cost
from deploy.bench.report import Report, Sheet, markdown, print_report, write_block
from deploy.bench.usage import read_usage
from deploy.cli import main
from deploy.launcher.process_table import resolve_scenario
from deploy.lockstep.lockstep import Lockstep
from shared.compiled import form
from shared.config import load_scenario
from shared.errors import ConfigError
from shared.formation import build_formation
from shared.messages import DroneState, HandSample, Heard, Mode, Wish
from shared.net.keyring import Keyring
from shared.net.settings import node_settings
from shared.nodes import all_nodes, dials, drone_node, endpoint
from shared.topics import DRONE_STATE, HAND

RHOMBUS = load_scenario("rhombus")
FORMATION = build_formation(RHOMBUS)
needs_proc = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads /proc")


def sent(node: int, number: int) -> bytes:
    return pack(Token(node, number, 1000 * number, 0, 0, number), 64)


def answer(hop: Hop, node: int, number: int) -> Token | None:
    payload = hop.hear(sent(node, number), 66, lambda: 77)
    return None if payload is None else unpack(payload)


def test_a_bare_node_answers_when_all_references_have_passed_the_sample_on() -> None:
    hop = Hop(4, (2, 3), 500)
    assert answer(hop, HAND_ID, 1) is None
    assert answer(hop, 2, 1) is None
    assert answer(hop, 1, 1) is None
    assert answer(hop, 3, 1) == Token(4, 1, 1000, 66, 77, 1)
    assert answer(hop, 3, 1) is None


def test_one_lost_sample_costs_a_bare_node_one_answer() -> None:
    hop = Hop(4, (2, 3), 500)
    heard = [(2, 1), (3, 1), (2, 2), (2, 3), (3, 3), (2, 4), (3, 4)]
    answers = [(token.number, token.seq) for node, number in heard if (token := answer(hop, node, number))]
    assert answers == [(1, 1), (3, 2), (4, 3)]


@given(size=st.integers(48, 4096), token=st.builds(Token, *[st.integers(0, 2**64 - 1)] * 6))
def test_a_payload_of_the_floor_has_the_size_asked_for(size: int, token: Token) -> None:
    payload = pack(token, size)
    assert len(payload) == size
    assert unpack(payload) == token


def test_bare_nodes_take_the_links_the_keys_and_the_references_of_the_agents() -> None:
    settings = resolve_scenario(RHOMBUS, FORMATION, range(9000, 9000 + len(all_nodes(FORMATION))), 9100)
    rows = {row.token: row.command for row in zenoh_rows(settings, FORMATION, dict.fromkeys(range(5), 99))}

    def values(token: str, option: str) -> list[str]:
        words = rows[token]
        return [words[i + 1] for i, word in enumerate(words) if word == option]

    assert set(rows) == {"relay/0", "drone/1", "drone/2", "drone/3", "drone/4"}
    assert values("drone/1", "--reference") == ["0"]
    assert values("drone/4", "--reference") == ["2", "3"]
    assert values("drone/4", "--hear") == [HAND.key(), *(DRONE_STATE.key(id=i) for i in (1, 2, 3))]
    assert values("drone/4", "--connect") == dials(settings, FORMATION, drone_node(4))
    assert values("drone/4", "--listen") == [endpoint(settings, FORMATION, drone_node(4))]
    assert values("relay/0", "--hear") == []


def test_over_udp_a_bare_node_sends_to_everyone_who_hears_the_agent() -> None:
    rows = {
        row.token: row.command
        for row in udp_rows(RHOMBUS, FORMATION, dict.fromkeys(range(5), 99), range(5000, 5005), 6000)
    }
    words = rows["drone/2"]
    assert words[words.index("--port") + 1] == "5002"
    assert [words[i + 1] for i, word in enumerate(words) if word == "--to"] == ["5001", "5003", "5004", "6000"]


def test_spread_counts_and_orders() -> None:
    of = spread(list(range(101)))
    assert (of.n, of.p10, of.p50, of.p90, of.p99) == (101, 10.0, 50.0, 90.0, 99.0)
    with pytest.raises(ValueError, match="nothing was measured"):
        spread([])


def test_hops_are_split_at_arrival_start_and_stamp() -> None:
    stats = DetailedStats(FORMATION)
    millisecond = 1_000_000

    def hand(seq: int, stamp: int) -> HandSample:
        return HandSample(
            epoch=1, seq=seq, stamp_ns=stamp, position=(0.0,) * 3, velocity=(0.0,) * 3, yaw=0.0, mode=Wish.FLY
        )

    def state(seq: int, heard_seq: int, arrival: int, start: int, stamp: int) -> DroneState:
        zero = (0.0, 0.0, 0.0)
        return DroneState(
            epoch=1,
            seq=seq,
            stamp_ns=stamp,
            id=1,
            position=zero,
            velocity=zero,
            goal=zero,
            goal_velocity=zero,
            setpoint=zero,
            mode=Mode.FOLLOW,
            heard={HAND.key(): Heard(1, heard_seq, arrival)},
            step_ns=start,
        )

    stats.update([hand(0, 0)], [state(0, 0, millisecond, 2 * millisecond, 3 * millisecond)])
    sent_ns = 20 * millisecond
    times = [sent_ns + n * millisecond for n in (1, 3, 6)]
    stats.update([hand(1, sent_ns)], [state(1, 1, *times)])
    assert stats.hops[1].transport == [1.0]
    assert stats.hops[1].wake == [2.0]
    assert stats.hops[1].step == [3.0]
    assert stats.latencies_ms[1] == [3.0, 6.0]


@needs_proc
def test_usage_grows_with_work_and_with_sleep() -> None:
    before = read_usage(os.getpid())
    end = time.process_time() + 0.1
    while time.process_time() < end:
        math.sqrt(2.0)
    for _ in range(20):
        time.sleep(0.0005)
    growth = read_usage(os.getpid()).since(before)
    assert growth.cpu_s >= 0.08
    assert growth.wakeups >= 20
    assert growth.rss_mb > 5.0


@needs_proc
def test_conditions_say_how_busy_others_were(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deploy.bench.machine._uptime", iter((100.0, 100.05, *[200.0] * 5)).__next__)
    conditions = Conditions()
    assert conditions.others_cores() is None, "too short to tell"
    others = conditions.others_cores()
    assert others is not None
    assert 0.0 <= others <= (os.cpu_count() or 1) + 1.0
    assert "Zenoh" in conditions.text()
    assert f"law {form()}" in conditions.text()
    assert conditions.facts()["form"] == str(form())
    assert "other processes used" in conditions.text()


def test_conditions_without_proc_leave_the_load_out(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("deploy.bench.machine._STAT", tmp_path / "none")
    conditions = Conditions()
    assert conditions.others_cores() is None
    assert "other processes" not in conditions.text()


def slower(quick: Callable[..., Any], seconds: float) -> Callable[..., Any]:
    def slow(*arguments: Any) -> Any:
        result = quick(*arguments)
        time.sleep(seconds)
        return result

    return slow


def test_two_milliseconds_in_the_step_show_up_as_two_milliseconds(monkeypatch: pytest.MonkeyPatch) -> None:
    (quick,) = step.measure(n=60).records
    monkeypatch.setattr(Agent, "step", slower(Agent.step, 0.002))
    (slow,) = step.measure(n=60).records
    # A busy machine may wake it later, never earlier.
    assert all(slow[whole] - quick[whole] > 1900.0 for whole in ("median_us", "step_us"))
    assert slow["receive_us"] < slow["step_us"]
    assert slow["n"] == 60


def test_a_tick_of_twenty_milliseconds_is_slower_than_real_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Lockstep, "advance", slower(Lockstep.advance, 0.02))
    (record,) = lockstep.measure(drones=[2], seconds=0.2).records
    assert 0.0 < record["realtime_factor"] < 1.0 / 60.0 / 0.02
    assert record["drones"] == 2


def test_large_swarms_run_as_a_flock() -> None:
    (record,) = lockstep.measure(drones=[lockstep.LARGEST_OF_AGENTS + 1], seconds=0.1).records
    assert record["kind"] == "flock"
    assert record["n"] >= lockstep.FEWEST
    assert math.isfinite(record["realtime_factor"])


SHEET = Sheet(title="Speed, m/s", columns=("", "median"), rows=(("swallow", "11"),))


def report(draw: Callable[[Any], None] = lambda _: None) -> Report:
    return Report(name="chain", records=({"p50_ms": 1.0},), sheets=(SHEET,), draw=draw)


def test_a_table_in_markdown() -> None:
    assert markdown(SHEET) == "Speed, m/s:\n\n|  | median |\n| --- | ---: |\n| swallow | 11 |"


def test_the_printed_table_says_what_it_depends_on(capsys: pytest.CaptureFixture[str]) -> None:
    print_report(report(), "2 cores", Console())
    text = capsys.readouterr().out
    assert "swallow" in text
    assert "2 cores" in text


def test_the_block_of_a_measurement_is_replaced_and_nothing_else(tmp_path: Path) -> None:
    file = tmp_path / "performance.md"
    file.write_text("before\n<!-- bench chain -->\nold\n<!-- end chain -->\nafter <!-- bench step -->\n")
    for _ in range(2):
        write_block(report(), "2 cores", file)
    text = file.read_text()
    assert text.startswith("before\n<!-- bench chain -->\n\nSpeed")
    assert text.endswith("2 cores.\n\n<!-- end chain -->\nafter <!-- bench step -->\n")
    assert "old" not in text
    assert text.count("swallow") == 1


def test_a_file_without_the_block_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "performance.md"
    file.write_text("no block")
    with pytest.raises(ConfigError, match="bench chain"):
        write_block(report(), "2 cores", file)
    assert file.read_text() == "no block"


def test_the_documentation_has_a_block_for_every_measurement() -> None:
    text = (Path(__file__).parents[2] / "docs" / "performance.md").read_text()
    for name in ("chain", "chain-field", "step", "scale", "lockstep", "start"):
        assert f"<!-- bench {name} -->" in text
        assert f"<!-- end {name} -->" in text


def test_pictures_are_the_same_every_time_and_transparent(tmp_path: Path) -> None:
    made = step.measure(n=20)
    one, other = tmp_path / "one.svg", tmp_path / "other.svg"
    save_plot(made, one)
    save_plot(made, other)
    assert one.read_bytes() == other.read_bytes()
    assert "#ffffff" not in one.read_text()
    assert "time, us" in one.read_text() or "<use" in one.read_text()


def test_a_format_that_nobody_can_draw_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"picture\.wav"):
        check_plot(tmp_path / "picture.wav")


def test_json_is_one_line_per_measurement(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "lockstep", "--drones", "2,3", "--seconds", "0.1", "--json"]) == 0
    output = capsys.readouterr()
    records = [json.loads(line) for line in output.out.splitlines()]
    assert [record["drones"] for record in records] == [2, 3]
    assert all(record["realtime_factor"] > 0.0 for record in records)
    assert "times real time" in output.err.replace("\n", " ") or "Simulators" in output.err


@pytest.mark.parametrize(
    "arguments",
    [[], ["fast"], ["scale", "--agents", "0"], ["scale", "--agents", "many"], ["chain", "--seconds", "0"]],
)
def test_wrong_usage_is_refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["bench", *arguments])
    assert ended.value.code == 2
    assert "usage: swarmtouch bench" in capsys.readouterr().err


@pytest.mark.parametrize("option", [("--plot", "picture.wav"), ("--update", "nowhere.md")])
def test_what_could_not_be_written_is_refused_before_anything_is_measured(
    option: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "chain", *option]) == 2
    output = capsys.readouterr()
    assert option[1] in output.err
    assert "round" not in output.err


def test_keys_of_a_measurement_live_as_long_as_it_does() -> None:
    with in_profile(RHOMBUS, FORMATION, "field") as flown:
        folder = Path(flown.net.keys)
        assert set(Keyring(folder).members()) == set(all_nodes(FORMATION))
        assert node_settings(flown, FORMATION, drone_node(1))["access_control"]["enabled"]
        cost = signature_cost(flown.net)
    assert not folder.exists()
    assert set(cost) == {"sign_us", "verify_us"}
    assert min(cost.values()) > 0.0


def test_a_scenario_keeps_its_own_keys_or_none() -> None:
    own = load_scenario("rhombus", ["net.keys=somewhere"])
    with in_profile(own, FORMATION, "field") as flown:
        assert (flown.net.profile, flown.net.keys) == ("field", "somewhere")
    for profile in ("laptop", None):
        with in_profile(RHOMBUS, FORMATION, profile) as flown:
            assert flown == RHOMBUS
    assert plain(own) == RHOMBUS
    assert signature_cost(RHOMBUS.net) == {}


def test_a_wrong_scenario_is_refused_before_anything_is_measured(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "chain", "--set", "impedance.stiffness=-1"]) == 2
    assert "stiffness" in capsys.readouterr().err
