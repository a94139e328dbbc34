"""A flight by hand from the console with real processes, and what becomes of it when the console dies."""

import math
import os
import re
import signal
import statistics
from pathlib import Path

import pytest

from shared.clock import NS_PER_S
from shared.messages import Mode, Wish
from shared.topics import HAND
from tests.integration.console_page import Page, open_page
from tests.integration.recorder import START_S, Recorder
from tests.integration.swarm import Launched, launched
from tests.integration.test_up import children_of

pytestmark = pytest.mark.timeout(150)

REACTION_S = 20.0
"""Within this time a swarm has reacted to a wish, on the busiest machine, too."""
MOVES = 20
MOST_SAMPLES = 4
"""From a page to a set-point: the console, the relay's next sample, the step."""
ADDRESS = re.compile(r"http://127\.0\.0\.1:(\d+)/")


def port_of(flight: Launched) -> int:
    """Returns the port of the console, once the launcher has announced it."""
    log = flight.runs / "launcher.log"
    flight.recorder.until(lambda: ADDRESS.search(log.read_text()) is not None, START_S)
    match = ADDRESS.search(log.read_text())
    assert match
    return int(match.group(1))


def pid_of_console(flight: Launched) -> int:
    (pid,) = (
        child
        for child in children_of(flight.launcher.pid)
        if b"observer.console" in Path(f"/proc/{child}/cmdline").read_bytes()
    )
    return pid


def take_off(page: Page, recorder: Recorder) -> None:
    page.say(type="take")
    page.until(lambda: page.newest["control"]["holder"] == page.newest["scene"]["you"], REACTION_S)
    page.point(*page.newest["scene"]["hand"]["start"])
    page.say(type="wish", wish="FLY")
    recorder.until(lambda: recorder.all_in(Mode.FOLLOW), START_S)


def input_to_setpoint(page: Page, recorder: Recorder) -> list[int]:
    """Moves the hand in steps; returns in how many samples of the hand each came to a set-point of drone 1.

    A step counts from the newest sample before it is sent; the hand is at rest before it.
    """
    samples, times = [], []
    x, y, z = page.newest["snapshot"]["hand"]["point"]
    for step in range(MOVES):
        recorder.listen(0.4)
        y += 0.05 if step % 2 else -0.05
        rest = max(recorder.hands.values(), key=lambda hand: (hand.epoch, hand.seq))
        sent_ns = recorder.clock()
        page.point(x, y, z)
        recorder.listen(0.25)
        moving = [
            hand
            for hand in recorder.hands.values()
            if hand.stamp_ns > sent_ns and math.dist(hand.position, rest.position) > 1e-5
        ]
        first = min(((h.epoch, h.seq) for h in moving), default=None)
        used = [s for s in recorder.since(1, sent_ns) if first and s.heard[HAND.key()][:2] >= first]
        if used:
            samples.append(used[0].heard[HAND.key()].seq - rest.seq)
            times.append((used[0].stamp_ns - sent_ns) / NS_PER_S)
    print(f"input to set-point: p50 {1e3 * statistics.median(times):.1f} ms, n = {len(times)}")
    return samples


def test_a_killed_console_means_hold_and_it_comes_back_to_fly_on(tmp_path: Path) -> None:
    with launched("slalom", "scripted:tour", tmp_path, arguments=("--console",)) as flight:
        recorder, port = flight.recorder, port_of(flight)
        with open_page(port) as page:
            page.say(type="take")
            page.until(lambda: page.newest["control"]["holder"] == 1, REACTION_S)
            x, y, z = page.newest["snapshot"]["hand"]["point"]
            page.point(x - 0.6, y, z)
            goal = recorder.latest(1).goal[0] - 0.4
            recorder.until(lambda: recorder.latest(1).position[0] < goal, START_S)
            assert recorder.all_in(Mode.FOLLOW)

            killed_ns = recorder.clock()
            os.kill(pid_of_console(flight), signal.SIGKILL)
            held = recorder.until(lambda: recorder.all_in(Mode.HOLD), REACTION_S)
            page.until(lambda: page.closed, REACTION_S)
        assert held > 0.1, "the hand counts as held until it has been silent for a while"

        with open_page(port) as page:
            assert page.newest["control"]["holder"] is None
            page.say(type="take")
            page.point(x - 0.2, y, z)
            recorder.until(lambda: recorder.all_in(Mode.FOLLOW), REACTION_S)
            recorder.listen(2.0)
            page.say(type="release")
            recorder.until(lambda: recorder.all_in(Mode.HOLD), REACTION_S)
            heights = [s.position[2] for i in recorder.ids for s in recorder.since(i, killed_ns)]
            assert min(heights) > 0.8, "nobody fell"
            summary = flight.end()
    assert summary["landed"] is True
    assert (summary["restarts"], summary["collisions"], summary["fence_exits"]) == (1, 0, 0)
    assert "Traceback" not in flight.logs()


def test_a_page_flies_from_take_off_to_landing_a_few_samples_behind(tmp_path: Path) -> None:
    with launched("slalom", "pointer://", tmp_path, arguments=("--console",), flying=False) as flight:
        recorder, port = flight.recorder, port_of(flight)
        with open_page(port) as watcher, open_page(port) as page:
            recorder.until(lambda: recorder.all_in(Mode.GROUND), START_S)
            take_off(page, recorder)
            samples = input_to_setpoint(page, recorder)
            assert len(samples) > MOVES * 0.8
            assert statistics.median(samples) <= MOST_SAMPLES, samples
            watcher.say(type="hand", point=[0.0, 0.0, 1.0], yaw=0.0)
            watcher.until(lambda: "refused" in watcher.newest, REACTION_S)

            page.point(-1.0, 0.0)
            watcher.until(lambda: watcher.counts["pattern"], START_S)

            page.say(type="wish", wish="GROUND")
            recorder.until(lambda: recorder.all_in(Mode.GROUND), START_S)
            page.say(type="wish", wish="FLY")
            recorder.until(lambda: recorder.all_in(Mode.FOLLOW), START_S)
            watcher.say(type="wish", wish="STOP")
            recorder.until(lambda: recorder.all_in(Mode.STOP), REACTION_S)
            assert max(recorder.hands.values(), key=lambda hand: hand.seq).mode is Wish.STOP
        summary = flight.end()
    assert summary["landed"] is False, "a stop is no landing"
    assert summary["restarts"] == 0
    assert "Traceback" not in flight.logs()
