"""One page holds the hand; whoever loses it, however that happens, leaves a swarm that holds."""

from shared.messages import Mode
from tests.browser.conftest import OpenPilot
from tests.browser.flight import ConsoleFlight
from tests.browser.pilot import PATIENCE_S, Pilot

HIDE = """
    Object.defineProperty(document, "hidden", { get: () => true });
    document.dispatchEvent(new Event("visibilitychange"));
"""


def swarm_holds(flight: ConsoleFlight) -> None:
    flight.recorder.until(lambda: flight.recorder.all_in(Mode.HOLD), PATIENCE_S)


def holder_says(pilot: Pilot, words: str) -> None:
    pilot.until(lambda: pilot.text("#hand-state") == words)


def test_two_pages_contend(open_pilot: OpenPilot, flight: ConsoleFlight) -> None:
    first, second = open_pilot(), open_pilot()
    first.take_off()
    holder = first.told("scene")["you"]
    holder_says(first, "you hold it")
    holder_says(second, f"page {holder} holds it")
    assert second.page.is_disabled("#fly")
    assert second.page.is_enabled("[data-order=STOP]")

    x, y, _ = first.hand()
    second.drag_hand(x + 0.5, y + 0.5)
    second.page.wait_for_timeout(500)
    assert abs(first.hand()[0] - x) < 0.05

    second.press("Ask for the hand")
    first.until(lambda: first.page.is_visible("#asked"))
    first.press("Keep")
    assert first.page.is_hidden("#asked")
    second.press("Asked; withdraw")
    second.press("Ask for the hand")
    first.until(lambda: first.page.is_visible("#asked"))
    first.press("Give")
    holder_says(second, "you hold it")
    holder_says(first, f"page {second.told('scene')['you']} holds it")
    second.press("Release the hand")
    holder_says(first, "free")
    swarm_holds(flight)


def test_closing_the_page_releases_the_hand(open_pilot: OpenPilot, flight: ConsoleFlight) -> None:
    watching, flying = open_pilot(), open_pilot()
    flying.take_off()
    flying.page.close()
    holder_says(watching, "free")
    swarm_holds(flight)


def test_hiding_the_page_releases_the_hand(open_pilot: OpenPilot, flight: ConsoleFlight) -> None:
    pilot = open_pilot()
    pilot.take_off()
    pilot.page.evaluate(HIDE)
    holder_says(pilot, "free")
    swarm_holds(flight)


def test_a_page_that_freezes_loses_the_hand(open_pilot: OpenPilot, flight: ConsoleFlight) -> None:
    watching, flying = open_pilot(), open_pilot()
    flying.take_off()
    flying.page.evaluate(
        "setTimeout(() => { const end = performance.now() + 1500; while (performance.now() < end); })"
    )
    holder_says(watching, "free")
    swarm_holds(flight)
