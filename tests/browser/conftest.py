"""A real browser before a real flight."""

import shutil
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, sync_playwright

from tests.browser.flight import ConsoleFlight, console_flight
from tests.browser.pilot import Pilot

CHROMIUM = shutil.which("chromium")
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--ignore-certificate-errors",
)

OpenPilot = Callable[..., Pilot]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "tests/browser/" in str(item.path):
            item.add_marker("browser")
            if CHROMIUM is None:
                item.add_marker(pytest.mark.skip(reason="no chromium; apt-get install chromium"))


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ConsoleFlight]:
    """The paper's rhombus, flown by whoever opens the page; every test leaves it without a holder."""
    with console_flight("rhombus", tmp_path_factory.mktemp("rhombus")) as flown:
        yield flown


@pytest.fixture
def open_pilot(browser: Browser, flight: ConsoleFlight) -> Iterator[OpenPilot]:
    """Opens pages; none may have logged an error or asked another host for anything."""
    pilots: list[Pilot] = []

    def open_one(url: str = flight.url, **options: Any) -> Pilot:
        pilots.append(Pilot(browser, url, **options))
        return pilots[-1]

    yield open_one
    for pilot in pilots:
        pilot.close()
    assert [error for pilot in pilots for error in pilot.errors] == []
    assert {host for pilot in pilots for host in pilot.hosts} <= {"127.0.0.1"}
