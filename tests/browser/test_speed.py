"""The page keeps up with a swarm of eight, and stays usable with thirty-two."""

import subprocess
import sys
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from deploy.launcher.ports import free_ports
from deploy.launcher.process_table import resolve_scenario
from shared.config import dump_scenario, load_scenario
from shared.formation import build_formation
from shared.nodes import all_nodes
from tests.browser.flight import another_console, console_flight
from tests.browser.pilot import Pilot

# Frames per second and the longest time between two of them (ms) over some seconds.
MEASURE = """(seconds) => new Promise((done) => {
    const times = [];
    const frame = (now) => {
        times.push(now);
        if (now - times[0] < 1000 * seconds) return requestAnimationFrame(frame);
        const gaps = times.slice(1).map((time, k) => time - times[k]);
        done([gaps.length / seconds, Math.max(...gaps)]);
    };
    requestAnimationFrame(frame);
})"""
SECONDS = 3
LEAST_SHARE = 0.5
LEAST_BUSY_SHARE = 0.08
"""Where the flight's own processes compete with the browser, which draws without a GPU, for two cores."""


def share_of_frames(pilot: Pilot, drones: int) -> float:
    """Measures frames per second as a fraction of what an empty page gets at the same time, and says so."""
    rate_hz, longest_ms = pilot.page.evaluate(MEASURE, SECONDS)
    empty = pilot.page.context.new_page()
    floor_hz, _ = empty.evaluate(MEASURE, SECONDS)
    empty.close()
    print(
        f"\n{drones} drones: {rate_hz:.1f} frames/s, the longest frame {longest_ms:.0f} ms;"
        f" an empty page {floor_hz:.1f} frames/s"
    )
    return float(rate_hz) / float(floor_hz)


def test_the_page_keeps_up_with_a_flight_of_eight(browser: Browser, tmp_path: Path) -> None:
    with console_flight("grid", tmp_path, "formation.n=8") as flight:
        pilot = Pilot(browser, flight.url)
        pilot.take_off()
        x, y, _ = pilot.hand()
        pilot.drag_hand(x - 1.0, y + 0.5)
        assert share_of_frames(pilot, 8) >= LEAST_BUSY_SHARE
        pilot.until(lambda: abs(pilot.hand()[1] - y - 0.5) < 0.1)
        pilot.close()
        assert pilot.errors == []


@pytest.mark.parametrize("drones", [8, 32])
def test_the_page_itself_draws_many_drones(browser: Browser, tmp_path: Path, drones: int) -> None:
    raw = load_scenario("grid", [f"formation.n={drones}"])
    formation = build_formation(raw)
    tcp, (udp,) = free_ports(tcp=len(all_nodes(formation)), udp=1)
    file = tmp_path / "scenario.toml"
    file.write_text(dump_scenario(resolve_scenario(raw, formation, tcp, udp, "pointer.sock")))
    swarm = subprocess.Popen([sys.executable, "-m", "tests.browser.stand_in", str(file)])
    try:
        with another_console(file, tmp_path) as url:
            pilot = Pilot(browser, url)
            pilot.until(lambda: pilot.text("#swarm-state") == f"{drones} following")
            pilot.press("Take the hand")
            pilot.until(lambda: pilot.text("#hand-state") == "you hold it")
            assert share_of_frames(pilot, drones) >= LEAST_SHARE
            pilot.close()
            assert pilot.errors == []
    finally:
        swarm.kill()
        swarm.wait()
