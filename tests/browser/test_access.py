"""A console that has a token shows itself only to those who know it."""

from pathlib import Path

from playwright.sync_api import Browser

from tests.browser.conftest import OpenPilot
from tests.browser.flight import ConsoleFlight, another_console

TOKEN = "known-to-this-test-only"  # noqa: S105  of a console that lives for one test
FORBIDDEN = 403


def test_the_token_is_refused_and_accepted(
    browser: Browser, open_pilot: OpenPilot, flight: ConsoleFlight, tmp_path: Path
) -> None:
    file = tmp_path / "token"
    file.write_text(TOKEN)
    with another_console(flight.file, tmp_path, "--token", f"@{file}") as url:
        bare, _, _ = url.partition("?")
        context = browser.new_context()
        page = context.new_page()
        for wrong in (bare, f"{bare}?token=wrong", f"{bare}main.js"):
            answer = page.goto(wrong)
            assert answer is not None
            assert answer.status == FORBIDDEN
        context.close()

        pilot = open_pilot(url)
        pilot.told("snapshot")
        assert "token" not in pilot.page.url
        pilot.until(lambda: pilot.text("#take") == "Take the hand")
        pilot.close()


def test_the_page_comes_back_to_a_console_that_comes_back(
    open_pilot: OpenPilot, flight: ConsoleFlight, tmp_path: Path
) -> None:
    with another_console(flight.file, tmp_path) as url:
        pilot = open_pilot(url)
        pilot.told("snapshot")
    pilot.until(lambda: pilot.text("#swarm-state") == "no connection")
    assert "Connection lost" in pilot.text("#coach")
    port = url.rstrip("/").rpartition(":")[2]
    with another_console(flight.file, tmp_path, "--port", port):
        pilot.until(lambda: pilot.text("#swarm-state") != "no connection")
        pilot.press("Take the hand")
        pilot.until(lambda: pilot.text("#hand-state") == "you hold it")
        pilot.close()
    pilot.errors = [error for error in pilot.errors if "ERR_CONNECTION_REFUSED" not in error]


def test_the_page_flies_over_https(open_pilot: OpenPilot, flight: ConsoleFlight, tmp_path: Path) -> None:
    with another_console(flight.file, tmp_path, "--tls", str(tmp_path / "tls")) as url:
        assert url.startswith("https://")
        pilot = open_pilot(url)
        pilot.press("Take the hand")
        pilot.until(lambda: pilot.text("#hand-state") == "you hold it")
        pilot.close()
