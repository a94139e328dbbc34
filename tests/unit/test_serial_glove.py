"""The serial glove on a simulated device that vanishes, comes back, and loses frames: in real time."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from glove_bridge.gloves.base import Outcome, Report
from glove_bridge.gloves.serial import SerialGlove
from glove_bridge.patterns import load_patterns
from shared.uri import parse_uri
from tests.simulated_glove import OFF, SimulatedGlove, simulated_glove

RIGHT = load_patterns("paper").patterns["R"]
LIMIT_S = 10.0
"""Time that no healthy machine needs; the events themselves are awaited."""


@pytest.fixture
def device(tmp_path: Path) -> Iterator[SimulatedGlove]:
    with simulated_glove(tmp_path / "port") as simulated:
        yield simulated


def opened(device: SimulatedGlove, options: str = "") -> SerialGlove:
    return SerialGlove(parse_uri(f"serial://{device.path}{options}", example=""))


def until(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.002)


def ended(glove: SerialGlove) -> list[str]:
    """Polls until the pattern has ended."""
    reports: list[Report] = []

    def over() -> bool:
        reports.extend(glove.poll(time.monotonic_ns()))
        return glove.next_ns() is None

    until(over)
    return [report.outcome.value for report in reports]


def test_a_device_that_comes_later_is_found(tmp_path: Path) -> None:
    device = SimulatedGlove(tmp_path / "port")
    with closing(opened(device)) as glove:
        glove.play(RIGHT, time.monotonic_ns())
        assert ended(glove) == ["failed"]
        assert not glove.connected
        device.plug()
        until(lambda: glove.connected)
        glove.play(RIGHT, time.monotonic_ns())
        assert ended(glove) == ["started", "finished"]
    device.unplug()


def test_unplugged_in_a_pattern_it_fails_and_the_next_one_plays(device: SimulatedGlove) -> None:
    with closing(opened(device)) as glove:
        until(lambda: glove.connected)
        for _ in range(2):
            glove.play(RIGHT, time.monotonic_ns())
            until(lambda: [r for r in glove.poll(time.monotonic_ns()) if r.outcome is Outcome.STARTED])
            device.unplug()
            assert ended(glove) == ["failed"]
            assert not glove.connected
            device.plug()
            until(lambda: glove.connected)
            assert device.device.plays == []
        glove.play(RIGHT, time.monotonic_ns())
        assert ended(glove) == ["started", "finished"]


def test_a_board_that_is_slow_to_start_is_asked_again(device: SimulatedGlove) -> None:
    device.lose = 5
    with closing(opened(device)) as glove:
        until(lambda: glove.connected)
        assert device.lose == 0


def test_on_a_dead_line_nothing_starts(device: SimulatedGlove) -> None:
    with closing(opened(device)) as glove:
        until(lambda: glove.connected)
        device.lose = 1_000_000
        glove.play(RIGHT, time.monotonic_ns())
        until(lambda: not glove.connected)
        assert ended(glove).count("started") == 0


def test_no_call_waits_for_the_line(device: SimulatedGlove) -> None:
    hangs, goes_on, went_on = threading.Event(), threading.Event(), threading.Event()

    def hang(*_: object) -> None:
        hangs.set()
        goes_on.wait(LIMIT_S)
        went_on.set()

    with closing(opened(device)) as glove:
        until(lambda: glove.connected)
        glove.link.order(hang)
        assert hangs.wait(LIMIT_S)
        for _ in range(100):
            glove.play(RIGHT, time.monotonic_ns())
            glove.poll(time.monotonic_ns())
            glove.stop(time.monotonic_ns())
        assert not went_on.is_set(), "all have returned, and the line still hangs"
        goes_on.set()


def test_a_line_that_hangs_ends_its_patterns_and_nothing_is_played_late(
    device: SimulatedGlove, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("glove_bridge.gloves.serial.OVERDUE_NS", 0)
    goes_on = threading.Event()

    def hang(*_: object) -> None:
        goes_on.wait(LIMIT_S)

    with closing(opened(device)) as glove:
        until(lambda: glove.connected)
        glove.link.order(hang)
        begun_ns = time.monotonic_ns()
        glove.play(RIGHT, begun_ns)
        assert ended(glove) == ["failed"]
        assert time.monotonic_ns() - begun_ns >= RIGHT.length_ms * 1_000_000
        assert glove.fault == "its line hangs"
        monkeypatch.undo()
        goes_on.set()
        until(lambda: device.device.obeys and not glove.poll(time.monotonic_ns()) and glove.connected)
        glove.play(RIGHT, time.monotonic_ns())
        assert ended(glove) == ["started", "finished"]
        assert len(device.device.plays) == 1, "the first one would have been about the past"


def test_closing_silences_the_motors_at_once(device: SimulatedGlove) -> None:
    glove = opened(device)
    until(lambda: glove.connected)
    glove.play(RIGHT, time.monotonic_ns())
    until(lambda: device.device.duties != OFF)
    glove.close()
    assert device.device.duties == OFF
    assert not glove.link._thread.is_alive()


def test_two_programs_do_not_share_a_glove(device: SimulatedGlove) -> None:
    with closing(opened(device)) as first, closing(opened(device)) as second:
        until(lambda: "exclusively lock" in first.link.session.fault + second.link.session.fault)
        until(lambda: first.connected != second.connected)


def test_by_radio_the_device_is_asked_for_a_longer_dead_man(device: SimulatedGlove) -> None:
    with closing(opened(device, "?link=xbee")) as glove:
        until(lambda: glove.connected)
        found = glove.link.session.device
        assert found is not None
        assert found.deadman_ms == 1000
        glove.play(RIGHT, time.monotonic_ns())
        assert ended(glove) == ["started", "finished"]
