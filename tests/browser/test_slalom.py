"""A visitor flies the demo's maze with the mouse; makes the picture of the README, runs/browser/console.png."""

import math
import time
from functools import partial
from pathlib import Path

from playwright.sync_api import Browser

from shared.messages import Mode
from tests.browser.flight import console_flight
from tests.browser.pilot import PATIENCE_S, Pilot
from tests.browser.test_layout import PICTURES

# Through the middle of each gate, and sideways between the rows of columns.
WAY = ((-3.1, 0.0), (-3.1, 1.0), (-4.5, 1.0), (-4.5, -0.8), (-5.9, -0.8), (-5.9, 0.4), (-7.3, 0.4))
PICTURE_AT = 3
BEHIND_THE_LAST_ROW = -7.75
NEAR_M = 0.15
A_MINUTE_S = 60.0


def test_a_visitor_flies_the_slalom_within_a_minute(browser: Browser, tmp_path: Path) -> None:
    with console_flight("slalom", tmp_path) as flight:
        pilot = Pilot(browser, flight.url)
        start = time.monotonic()
        pilot.take_off()
        for number, (x, y) in enumerate(WAY):
            pilot.drag_hand(x, y)
            if number == PICTURE_AT:
                pilot.page.wait_for_selector(".finger[data-hz]")
                PICTURES.mkdir(parents=True, exist_ok=True)
                pilot.page.screenshot(path=PICTURES / "console.png")
            pilot.until(partial(settled, pilot, x, y))
        assert all(drone["position"][0] < BEHIND_THE_LAST_ROW for drone in pilot.told("snapshot")["drones"])
        assert time.monotonic() - start < A_MINUTE_S
        referee = pilot.told("health")["referee"]
        assert referee["collisions"] == 0
        pilot.press("Land")
        pilot.until_mode("GROUND")
        pilot.close()
        assert pilot.errors == []


def test_space_stops_every_motor_from_any_page(browser: Browser, tmp_path: Path) -> None:
    with console_flight("rhombus", tmp_path) as flight:
        flying, watching = Pilot(browser, flight.url), Pilot(browser, flight.url)
        flying.take_off()
        watching.page.focus("#sound")
        watching.page.evaluate("WebSocket.prototype.send = () => {}")  # it hangs: STOP has another way
        watching.page.keyboard.press("Space")
        heard = flight.recorder
        heard.until(lambda: {heard.latest(i).mode for i in heard.ids} == {Mode.STOP}, PATIENCE_S)
        assert watching.page.get_attribute("#sound", "aria-pressed") == "false"
        flying.close()
        watching.close()


def settled(pilot: Pilot, x: float, y: float) -> bool:
    """Says whether the hand is there, and every drone near its goal."""
    hand = pilot.hand()
    drones = pilot.told("snapshot")["drones"]
    return math.dist(hand[:2], (x, y)) < NEAR_M and all(
        math.dist(drone["position"], drone["goal"]) < 2 * NEAR_M for drone in drones
    )
