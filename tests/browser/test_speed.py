"""The page keeps up with a swarm of eight, and stays usable with thirty-two."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser

from tests.browser.flight import console_flight
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


@pytest.mark.parametrize(("drones", "least_hz"), [(8, 30.0), (32, 10.0)])
def test_the_page_keeps_up(browser: Browser, tmp_path: Path, drones: int, least_hz: float) -> None:
    with console_flight("grid", tmp_path, f"formation.n={drones}") as flight:
        pilot = Pilot(browser, flight.url)
        pilot.take_off()
        x, y, _ = pilot.hand()
        pilot.drag_hand(x - 1.0, y + 0.5)
        rate_hz, longest_ms = pilot.page.evaluate(MEASURE, 3)
        cpu = {process["name"]: process["cpu"] for process in pilot.told("health")["processes"]}
        print(f"\n{drones} drones: {rate_hz:.1f} frames/s, longest {longest_ms:.0f} ms")
        print(f"console {cpu.get('console', 0.0):.0%} of a core, the whole flight {sum(cpu.values()):.0%}")
        pilot.until(lambda: abs(pilot.hand()[1] - y - 0.5) < 0.1)
        assert rate_hz >= least_hz
        pilot.press("Land")
        pilot.until_mode("GROUND")
        pilot.close()
        assert pilot.errors == []
