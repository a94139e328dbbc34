"""The glove in the launcher and on the command line: process row, log, panel, summary, pictures."""

import io
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from rich.console import Console

from deploy.cli import main
from deploy.glove.show import frames_text
from deploy.glove.svg import draw_svg
from deploy.launcher.glove_panel import GlovePanel
from deploy.launcher.process_table import GloveChoice, process_table
from deploy.launcher.summary import _glove_table
from glove_bridge.gloves.terminal import draw
from glove_bridge.patterns import load_patterns
from observer.glove_log import GloveLog
from shared.config import load_scenario
from shared.formation import build_formation
from shared.messages import Heard, PatternEvent, ProcessStatus

MS = 1_000_000
START = 5_000 * MS


def event(pattern: str, outcome: str, started_ns: int = 0, **heard: int) -> PatternEvent:
    return PatternEvent(
        epoch=1,
        seq=0,
        stamp_ns=0,
        pattern=pattern,
        outcome=outcome,
        state_seq=0,
        heard={key.replace("_", "/"): Heard(1, 1, arrival) for key, arrival in heard.items()},
        started_ns=started_ns,
    )


def test_the_bridge_starts_before_the_relay_and_only_with_a_glove() -> None:
    scenario = load_scenario("rhombus")
    worn = GloveChoice(uri="terminal://", patterns="flight")

    def rows(glove: GloveChoice | None) -> list[tuple[str, tuple[str, ...]]]:
        table = process_table(
            scenario,
            build_formation(scenario),
            file=Path("s.toml"),
            hand="scripted:tour",
            run_dir=Path("run"),
            glove=glove,
        )
        return [(row.token, row.command) for row in table]

    tokens = [token for token, _ in rows(worn)]
    assert tokens[-2:] == ["bridge/0", "relay/0"]
    assert "bridge/0" not in [token for token, _ in rows(None)]
    command = dict(rows(worn))["bridge/0"]
    assert command == (
        *(sys.executable, "-P", "-m", "glove_bridge", "--scenario", "s.toml"),
        *("--glove", "terminal://", "--patterns", "flight"),
    )


def test_the_log_counts_outcomes_and_measures_the_newest_drone_state() -> None:
    log = GloveLog()
    assert log.latency_ms.quantiles() == (None, None)
    log.add(event("CR", "started", START, drone_1_state=START - 7 * MS, human_hand=START - MS))
    log.add(event("CR", "finished", START))
    log.add(event("CL", "suppressed"))
    log.add(event("ER", "failed"))
    log.add(event("ER", "failed", START))
    assert (log.delivered, log.played, log.suppressed) == ({"CR": 1}, {"CR": 1}, {"CL": 1})
    assert (log.failed, log.lost) == ({"ER": 2}, {"ER": 1})
    assert log.latency_ms.quantile(0.5) == pytest.approx(7.0, rel=0.02)
    assert log.latest is not None
    assert log.latest.pattern == "ER"


def test_the_panel_moves_with_the_pattern() -> None:
    moments = iter(START + ms * MS for ms in (0, 250, 650, 750))
    panel = GlovePanel("paper", lambda: next(moments))
    frames = load_patterns("paper").patterns["EI"].frames
    assert panel.line(None) == f"glove  {draw(None)}"
    begun = event("EI", "started", START)
    assert [panel.line(begun) for _ in frames] == [f"glove  {draw(frame)}  EI" for frame in frames]
    assert panel.line(begun) == f"glove  {draw(None)}  EI started"
    assert panel.line(event("FENCE", "failed")) == f"glove  {draw(None)}  FENCE failed"
    assert panel.line(event("UNKNOWN", "started", START)) == f"glove  {draw(None)}"


def test_frames_in_one_line() -> None:
    paper, cues = load_patterns("paper").patterns, load_patterns("cues").patterns
    assert frames_text(paper["EI"]) == "3@150 200, {2,4}@200 200, {1,5}@250 300"
    assert frames_text(cues["LOW_BATTERY"]) == "{1,2}@250 300, - 200, {1,2}@250 300"


def test_a_picture_has_one_bar_per_vibrating_finger_and_frame() -> None:
    patterns = load_patterns("paper")
    picture = ET.fromstring(draw_svg(patterns))  # noqa: S314  our own
    bars = [element for element in picture.iter() if element.find("{*}title") is not None]
    assert len(bars) == sum(len(frame.hz) for p in patterns.patterns.values() for frame in p.frames)


def test_sets_are_listed_shown_compared_and_drawn(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    assert main(["glove", "patterns"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in ("paper", "distinct", "flight-2018", "DRONE_LOST"))
    picture = tmp_path / "set.svg"
    assert main(["glove", "patterns", "distinct", "--compare", "paper", "--svg", str(picture)]) == 0
    shown = capsys.readouterr().out
    assert "{1,3,5}@250 150" in shown
    assert "predictions of a fitted model of perception, not measurements" in shown
    assert "92.9%" in shown
    assert "83.2%" in shown
    assert picture.read_text().startswith("<svg")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--play"], "which set? For example"),
        (["papr"], "did you mean 'paper'?"),
        (["paper", "--svg", "/dev/full/x.svg"], "/dev/full/x.svg"),
    ],
)
def test_a_wrong_request_is_refused(
    arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code: object = main(["glove", "patterns", *arguments])
    except SystemExit as refused:
        code = refused.code
    assert code == 2
    assert expected in capsys.readouterr().err


def test_playing_draws_every_frame_in_order() -> None:
    command = (sys.executable, "-m", "deploy.cli", "glove", "patterns", "flight", "--play")
    played = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    names = [line.split()[-1] for line in played.splitlines() if line.startswith(("···", "███"))]
    assert names == ["CR"] * 3 + ["CL"] * 3 + ["ER", "EL"]


def test_the_summary_table_lists_patterns() -> None:
    glove = {
        "uri": "terminal://",
        "patterns": "flight",
        "played": {"CR": 3},
        "delivered": {"CR": 3},
        "suppressed": {"CL": 1},
        "failed": {"EL": 2},
        "lost": {"EL": 1},
        "latency_ms": {"p50": 2.5, "p99": None},
    }
    console = Console(width=100, file=io.StringIO())
    with console.capture() as captured:
        console.print(_glove_table(glove))
    rows = [line.split() for line in captured.get().splitlines()]
    assert ["CR", "3", "3", "0", "0", "0"] in rows
    assert ["EL", "0", "0", "0", "2", "1"] in rows
    assert ["CL", "0", "0", "1", "0", "0"] in rows


def bridge_status(glove_there: float) -> ProcessStatus:
    return ProcessStatus(
        epoch=1,
        seq=0,
        stamp_ns=0,
        role="bridge",
        id=0,
        pid=1,
        host="h",
        state="running",
        metrics={"glove_there": glove_there},
    )


def test_what_the_glove_cannot_make_felt_is_told_once() -> None:
    panel, log = GlovePanel("flight"), GloveLog()
    assert panel.unfelt(log.failed, None) == []
    log.add(event("ER", "failed"))
    assert panel.unfelt(log.failed, bridge_status(1.0)) == [], "the state of the formation is no alarm"
    log.add(event("DRONE_LOST", "failed"))
    assert panel.unfelt(log.failed, bridge_status(0.0)) == [
        "the glove cannot be felt: see bridge.log",
        "NOT FELT: drone lost",
    ]
    assert panel.unfelt(log.failed, bridge_status(0.0)) == []
    log.add(event("DRONE_LOST", "failed"))
    log.add(event("FENCE", "started", START))
    assert panel.unfelt(log.failed, bridge_status(1.0)) == ["the glove can be felt", "NOT FELT: drone lost"]


def test_a_glove_that_no_bridge_could_open_is_refused_before_anything_starts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["up", "rhombus", "--glove", "cloud://", "--runs", str(tmp_path / "runs")]) == 2
    assert "glove 'cloud://': no such backend" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()
