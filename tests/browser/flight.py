"""Flights by `swarmtouch up --console`, heard from outside."""

import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from attrs import frozen

from shared.config import load_scenario
from tests.integration.recorder import START_S, Recorder

_ADDRESS = re.compile(r"https?://\S+")


@frozen
class ConsoleFlight:
    """A flight whose hand is the page at `url`.

    Attributes:
        url: Address of the page.
        recorder: Hears what the drones say, whatever the page shows.
        file: The resolved scenario.
    """

    url: str
    recorder: Recorder
    file: Path


@contextmanager
def console_flight(scenario: str, runs: Path, *overrides: str) -> Iterator[ConsoleFlight]:
    """Starts a flight that a page is to fly; ends it for sure."""
    command = [sys.executable, "-m", "deploy.cli", "up", scenario, "--console", "--hand", "pointer://"]
    command += ["--runs", str(runs), "--json", *(a for o in overrides for a in ("--set", o))]
    latest = runs / "latest"
    with (runs / "launcher.log").open("wb") as log:
        launcher = subprocess.Popen(command, stdout=log, stderr=log)
    try:
        url = _eventually(lambda: address_in(latest / "logs" / "console.log"))
        file = latest / "scenario.toml"
        with Recorder(load_scenario(file)) as recorder:
            yield ConsoleFlight(url, recorder, file)
    finally:
        launcher.send_signal(signal.SIGINT)
        try:
            launcher.wait(START_S)
        finally:
            launcher.kill()


@contextmanager
def another_console(scenario: Path, folder: Path, *arguments: str) -> Iterator[str]:
    """Starts a console for a resolved scenario; gives its address."""
    log = folder / "another-console.log"
    command = [sys.executable, "-m", "observer.console", "--scenario", str(scenario), "--port", "0"]
    with log.open("wb") as output:
        process = subprocess.Popen([*command, *arguments], stdout=output, stderr=output)
    try:
        yield _eventually(lambda: address_in(log))
    finally:
        process.terminate()
        process.wait(10.0)


def address_in(log: Path) -> str:
    """Returns the address that a console has printed, empty before it has."""
    found = _ADDRESS.search(log.read_text(errors="replace")) if log.exists() else None
    return found.group() if found else ""


def _eventually(look: Callable[[], str]) -> str:
    deadline = time.monotonic() + START_S
    while not (found := look()):
        assert time.monotonic() < deadline, f"nothing within {START_S} s"
        time.sleep(0.02)
    return found
