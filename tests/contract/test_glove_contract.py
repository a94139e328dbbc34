"""What every glove backend promises, and what each one shows."""

import io
import json
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from glove_bridge.gloves import BACKENDS, open_glove
from glove_bridge.gloves.base import Glove, Outcome, Report
from glove_bridge.gloves.record import RecordGlove
from glove_bridge.gloves.terminal import TerminalGlove, draw
from glove_bridge.patterns import load_patterns
from glove_bridge.patterns.pattern import Frame
from shared.errors import ConfigError

MS = 1_000_000
START = 5_000 * MS
PAPER = load_patterns("paper").patterns
EI, RIGHT = PAPER["EI"], PAPER["R"]

URIS: dict[str, Callable[[Path], str]] = {
    "none": lambda _: "none://",
    "terminal": lambda _: "terminal://",
    "screen": lambda _: "screen://",
    "record": lambda folder: f"record://{folder}/glove.jsonl",
}


def test_every_backend_is_under_contract() -> None:
    assert set(URIS) == set(BACKENDS)


@pytest.fixture(params=sorted(BACKENDS))
def glove(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Glove]:
    with closing(open_glove(URIS[request.param](tmp_path))) as opened:
        yield opened


def play_to_end(glove: Glove, start_ns: int) -> list[Report]:
    """Polls exactly when the glove asks for it."""
    reports = glove.poll(start_ns)
    while (now := glove.next_ns()) is not None:
        reports += glove.poll(now)
    return reports


def test_a_pattern_starts_at_once_and_ends_when_it_should(glove: Glove) -> None:
    glove.play(EI, START)
    reports = play_to_end(glove, START)
    if glove.connected:
        assert reports == [(Outcome.STARTED, START), (Outcome.FINISHED, START + 700 * MS)]
    else:
        assert reports == [(Outcome.FAILED, START)]
    assert glove.poll(START + 9_000 * MS) == []


def test_patterns_follow_each_other(glove: Glove) -> None:
    outcomes = []
    for k in range(3):
        now = START + k * 2_000 * MS
        glove.play(RIGHT, now)
        outcomes += [report.outcome for report in play_to_end(glove, now)]
    expected = [Outcome.STARTED, Outcome.FINISHED] if glove.connected else [Outcome.FAILED]
    assert outcomes == 3 * expected


def test_a_late_poll_does_not_stretch_a_pattern(glove: Glove) -> None:
    glove.play(EI, START)
    reports = glove.poll(START + 5_000 * MS)
    if glove.connected:
        assert reports[-1] == (Outcome.FINISHED, START + 700 * MS)
    assert glove.next_ns() is None


def test_stop_fails_what_plays_and_frees_the_glove(glove: Glove) -> None:
    glove.play(RIGHT, START)
    glove.stop(START + 300 * MS)
    glove.stop(START + 301 * MS)
    reports = glove.poll(START + 302 * MS)
    assert reports[-1].outcome is Outcome.FAILED
    assert [report.outcome for report in reports].count(Outcome.FAILED) == 1
    assert glove.next_ns() is None
    glove.play(EI, START + 400 * MS)
    assert play_to_end(glove, START + 400 * MS)[-1].outcome in (Outcome.FINISHED, Outcome.FAILED)


def test_stop_without_a_pattern_is_nothing(glove: Glove) -> None:
    glove.stop(START)
    assert glove.poll(START) == []


def test_a_second_pattern_fails_the_first(glove: Glove) -> None:
    glove.play(RIGHT, START)
    glove.play(EI, START + 100 * MS)
    reports = play_to_end(glove, START + 100 * MS)
    if glove.connected:
        assert [r.outcome for r in reports] == ["started", "failed", "started", "finished"]
        assert reports[-1].at_ns == START + 800 * MS
    else:
        assert [r.outcome for r in reports] == ["failed", "failed"]


def test_closing_twice_and_using_it_afterwards_is_harmless(glove: Glove) -> None:
    glove.play(EI, START)
    glove.close()
    glove.close()
    assert not glove.connected
    glove.play(EI, START + 10 * MS)
    assert glove.poll(START + 20 * MS)[-1].outcome is Outcome.FAILED


def test_a_record_is_one_line_per_frame(tmp_path: Path) -> None:
    with closing(open_glove(f"record://{tmp_path}/a%20b.jsonl")) as glove:
        glove.play(EI, START)
        play_to_end(glove, START)
    lines = [json.loads(line) for line in (tmp_path / "a b.jsonl").read_text().splitlines()]
    assert [(line["frame"], line["hz"], line["ms"]) for line in lines] == [
        (0, [0, 0, 150, 0, 0], 200),
        (1, [0, 200, 0, 200, 0], 200),
        (2, [250, 0, 0, 0, 250], 300),
        (None, [0, 0, 0, 0, 0], 0),
    ]
    assert [line["t_ns"] - START for line in lines] == [0, 200 * MS, 400 * MS, 700 * MS]
    assert {line["pattern"] for line in lines} == {"EI"}


def test_a_full_disk_fails_patterns_and_raises_nothing() -> None:
    glove = RecordGlove("/dev/full")
    glove.play(EI, START)
    assert [report.outcome for report in glove.poll(START)] == ["started", "failed"]
    assert not glove.connected


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_is_redrawn_in_place() -> None:
    stream = Terminal()
    glove = TerminalGlove(stream=stream)
    glove.play(EI, START)
    play_to_end(glove, START)
    glove.close()
    *frames, last = stream.getvalue().split("\r\x1b[K")[1:]
    assert [frame.split() for frame in frames] == [
        ["···", "···", "░░░", "···", "···", "EI"],
        ["···", "▒▒▒", "···", "▒▒▒", "···", "EI"],
        ["███", "···", "···", "···", "███", "EI"],
    ]
    assert last == "··· ··· ··· ··· ···  EI\n"


def test_elsewhere_there_is_one_line_per_frame() -> None:
    stream = io.StringIO()
    glove = TerminalGlove(stream=stream)
    glove.play(RIGHT, START)
    play_to_end(glove, START)
    lines = stream.getvalue().splitlines()
    assert len(lines) == 5
    assert lines[1] == f"{draw(Frame(200, {2: 250.0}))}  R"
    assert "\x1b" not in stream.getvalue()


def test_a_terminal_that_is_gone_fails_patterns() -> None:
    stream = io.StringIO()
    glove = TerminalGlove(stream=stream)
    stream.close()
    glove.play(EI, START)
    assert glove.poll(START)[-1].outcome is Outcome.FAILED


@pytest.mark.parametrize(
    ("uri", "expected"),
    [
        ("serial", "glove 'serial': no such backend; known: none://, terminal://, record://"),
        ("cloud://x", "no such backend"),
        ("record://", "record://: no file; for example"),
        ("record:///nowhere/x.jsonl", "cannot be written"),
    ],
)
def test_a_wrong_uri_is_refused_with_a_hint(uri: str, expected: str) -> None:
    with pytest.raises(ConfigError) as refused:
        open_glove(uri)
    assert expected in str(refused.value)
