"""Builds firmware, fuzzer and simulated chip once; without the toolchain tests skip and say what is missing."""

import fcntl
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.chip.simulated_chip import ROOT, SimulatedChip

NEEDED = {
    "make": shutil.which("make"),
    "gcc libc6-dev": shutil.which("cc"),
    "gcc-avr": shutil.which("avr-gcc"),
    "avr-libc": Path("/usr/lib/avr/include/avr/io.h").exists(),
    "arduino-core-avr": Path("/usr/share/arduino/hardware/arduino/avr/cores").exists(),
    "libsimavr-dev": Path("/usr/include/simavr/sim_avr.h").exists(),
    "libelf-dev": Path("/usr/include/libelf.h").exists(),
    "clang libclang-rt-14-dev": shutil.which("clang++"),
}
"""Debian packages -> something that they bring."""


@pytest.fixture(scope="session")
def built() -> str:
    """Builds everything into `build/` and returns what `make chip` has printed."""
    missing = [package for package, there in NEEDED.items() if not there]
    if missing:
        say = pytest.fail if "CI" in os.environ else pytest.skip
        say(f"on Debian: apt-get install --no-install-recommends {' '.join(missing)}")
    folder = ROOT / "build"
    folder.mkdir(exist_ok=True)
    with (folder / "chip.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # of the workers of one run the first builds
        command = [str(NEEDED["make"]), "chip"]
        make = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert make.returncode == 0, make.stderr
    return make.stdout


@pytest.fixture
def start_chip(built: str, tmp_path: Path) -> Iterator[Callable[..., SimulatedChip]]:  # noqa: ARG001
    """Starts simulated chips with options of `simulated_uno`; they end with the test."""
    with ExitStack() as chips:
        yield lambda *options: chips.enter_context(SimulatedChip(tmp_path, *options))


@pytest.fixture
def chip(start_chip: Callable[..., SimulatedChip]) -> SimulatedChip:
    """Starts a simulated chip on a perfect line."""
    return start_chip()
