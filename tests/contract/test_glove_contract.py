"""What every glove backend promises, and what each one shows."""

import io
import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import pytest

from glove_bridge.gloves import BACKENDS, check_glove, open_glove
from glove_bridge.gloves.base import Glove, Outcome, Report
from glove_bridge.gloves.terminal import TerminalGlove, draw
from glove_bridge.patterns import load_patterns
from glove_bridge.patterns.pattern import Frame, Pattern
from shared.clock import NS_PER_S
from shared.errors import ConfigError
from tests.simulated_glove import simulated_glove

MS = 1_000_000
START = 5_000 * MS
PAPER = load_patterns("paper").patterns
EI, RIGHT = PAPER["EI"], PAPER["R"]

URIS: dict[str, Callable[[Path], str]] = {
    "none": lambda _: "none://",
    "terminal": lambda _: "terminal://",
    "screen": lambda _: "screen://",
    "record": lambda folder: f"record://{folder}/glove.jsonl",
    "serial": lambda folder: f"serial://{folder}/port",
}


class VirtualTime:
    """For gloves that have no clock but that of their caller: exact."""

    def __init__(self) -> None:
        self.now_ns = START

    def pass_until(self, then_ns: int) -> None:
        self.now_ns = then_ns

    def agrees(self, at_ns: int, expected_ns: int) -> bool:
        return at_ns == expected_ns


class RealTime:
    """For gloves with a clock of their own: never early; how late depends on this machine."""

    now_ns = property(lambda _: time.monotonic_ns())

    def pass_until(self, then_ns: int) -> None:
        time.sleep(max(0, then_ns - self.now_ns) / NS_PER_S)

    def agrees(self, at_ns: int, expected_ns: int) -> bool:
        return at_ns >= expected_ns - 2 * MS


class Worn(NamedTuple):
    glove: Glove
    time: VirtualTime | RealTime

    def poll(self) -> list[Report]:
        return self.glove.poll(self.time.now_ns)

    def play(self, pattern: Pattern) -> int:
        begun_ns: int = self.time.now_ns
        self.glove.play(pattern, begun_ns)
        return begun_ns

    def play_to_end(self, pattern: Pattern) -> list[Report]:
        self.play(pattern)
        return self.to_end()

    def to_end(self) -> list[Report]:
        """Polls exactly when the glove asks for it."""
        reports = self.poll()
        while (next_ns := self.glove.next_ns()) is not None:
            self.time.pass_until(next_ns)
            reports += self.poll()
        return reports

    def rest(self, ms: int) -> None:
        self.time.pass_until(self.time.now_ns + ms * MS)


def outcomes(reports: list[Report]) -> list[str]:
    return [report.outcome.value for report in reports]


def test_every_backend_is_under_contract() -> None:
    assert set(URIS) == set(BACKENDS)


@pytest.fixture(params=sorted(BACKENDS))
def worn(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Worn]:
    uri = URIS[request.param](tmp_path)
    if request.param != "serial":
        with closing(open_glove(uri)) as glove:
            yield Worn(glove, VirtualTime())
        return
    with simulated_glove(tmp_path / "port"), closing(open_glove(uri)) as glove:
        while not glove.connected:
            time.sleep(0.005)
        yield Worn(glove, RealTime())


def test_a_pattern_starts_at_once_and_ends_when_it_should(worn: Worn) -> None:
    begun_ns = worn.play(EI)
    reports = worn.to_end()
    if not worn.glove.connected:
        assert reports == [Report(Outcome.FAILED, START, worn.glove.fault)]
    else:
        assert outcomes(reports) == ["started", "finished"]
        assert worn.time.agrees(reports[0].at_ns, begun_ns)
        assert worn.time.agrees(reports[1].at_ns, begun_ns + 700 * MS)
    worn.rest(100)
    assert worn.poll() == []


def test_patterns_follow_each_other(worn: Worn) -> None:
    reports = [worn.play_to_end(EI) for _ in range(3)]
    expected = ["started", "finished"] if worn.glove.connected else ["failed"]
    assert list(map(outcomes, reports)) == 3 * [expected]


def test_a_late_poll_does_not_stretch_a_pattern(worn: Worn) -> None:
    begun_ns = worn.play(EI)
    worn.rest(1_500)
    reports = worn.poll()
    if worn.glove.connected:
        assert outcomes(reports) == ["started", "finished"]
        assert worn.time.agrees(reports[-1].at_ns, begun_ns + 700 * MS)
        assert reports[-1].at_ns < begun_ns + 1_500 * MS
    assert worn.glove.next_ns() is None


def test_stop_fails_what_plays_and_frees_the_glove(worn: Worn) -> None:
    worn.play(RIGHT)
    worn.rest(300)
    worn.glove.stop(worn.time.now_ns)
    worn.rest(1)
    worn.glove.stop(worn.time.now_ns)
    reports = worn.to_end()
    assert reports[-1].outcome is Outcome.FAILED
    assert outcomes(reports).count("failed") == 1
    assert worn.glove.next_ns() is None
    expected = "finished" if worn.glove.connected else "failed"
    assert outcomes(worn.play_to_end(EI))[-1] == expected


def test_stop_without_a_pattern_is_nothing(worn: Worn) -> None:
    worn.glove.stop(worn.time.now_ns)
    assert worn.to_end() == []


def test_a_second_pattern_fails_the_first(worn: Worn) -> None:
    worn.play(RIGHT)
    worn.rest(100)
    begun_ns = worn.play(EI)
    reports = worn.to_end()
    if worn.glove.connected:
        assert outcomes(reports) == ["started", "failed", "started", "finished"]
        assert worn.time.agrees(reports[-1].at_ns, begun_ns + 700 * MS)
    else:
        assert outcomes(reports) == ["failed", "failed"]


def test_closing_twice_and_using_it_afterwards_is_harmless(worn: Worn) -> None:
    worn.play(EI)
    worn.glove.close()
    worn.glove.close()
    assert not worn.glove.connected
    worn.play(EI)
    assert worn.poll()[-1].outcome is Outcome.FAILED
    assert worn.glove.next_ns() is None


def test_a_record_is_one_line_per_frame(tmp_path: Path) -> None:
    with closing(open_glove(f"record://{tmp_path}/a%20b.jsonl")) as glove:
        Worn(glove, VirtualTime()).play_to_end(EI)
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
    glove = open_glove("record:///dev/full")
    glove.play(EI, START)
    assert [report.outcome for report in glove.poll(START)] == ["started", "failed"]
    assert not glove.connected


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_is_redrawn_in_place() -> None:
    stream = Terminal()
    glove = TerminalGlove(stream=stream)
    Worn(glove, VirtualTime()).play_to_end(EI)
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
    Worn(glove, VirtualTime()).play_to_end(RIGHT)
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
        ("serial", "glove 'serial': no such backend; known: none://, terminal://, record://, serial://"),
        ("cloud://x", "no such backend"),
        ("record://", "record://: no file; for example"),
        ("record:///nowhere/x.jsonl", "cannot be written"),
        ("terminal://?fast=1", "unknown option 'fast'; there are none"),
        ("serial://", "no device; for example serial:///dev/ttyACM0"),
        ("serial:///dev/x?speed=9600", "unknown option 'speed'; known ones: baud, link, calibration"),
        ("serial:///dev/x?baud=1", "baud=1; known ones: 9600, 19200"),
        ("serial:///dev/x?link=wifi", "link=wifi; known ones: usb, xbee"),
        ("serial:///dev/x?calibration=/nowhere.toml", "/nowhere.toml: cannot be read"),
    ],
)
def test_a_wrong_uri_is_refused_with_a_hint(uri: str, expected: str) -> None:
    for door in (open_glove, check_glove):
        with pytest.raises(ConfigError) as refused:
            door(uri)
        assert expected in str(refused.value)


def test_a_check_touches_no_device(tmp_path: Path) -> None:
    fifo = tmp_path / "port"
    os.mkfifo(fifo)
    for uri in (
        "terminal://",
        "none://",
        "screen://",
        f"record://{tmp_path}/felt",
        f"serial://{fifo}?link=xbee",
    ):
        check_glove(uri)
    with pytest.raises(OSError, match="No such device"):  # nobody has it open for reading
        os.open(fifo, os.O_WRONLY | os.O_NONBLOCK)
