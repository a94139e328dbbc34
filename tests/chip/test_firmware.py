"""What is built: its size, and that the firmware in the repository is built from the source beside it."""

import re
import shutil
import subprocess

import pytest

from tests.chip.simulated_chip import ROOT

COMPILER = "5.4.0"
"""Of Debian 12; another one builds other bytes."""

FOLDER = ROOT / "glove_bridge" / "firmware"
FLASH, RAM = 32_256, 2_048
"""Of an Arduino UNO: the bootloader has the last 512 B of flash."""
STACK = 1_024
"""RAM that is left to the stack at least."""


def compiler() -> str | None:
    found = shutil.which("avr-gcc")
    if found is None:
        return None
    return subprocess.run([found, "-dumpversion"], capture_output=True, text=True, check=True).stdout.strip()


pytestmark = [
    pytest.mark.chip,
    pytest.mark.parallel,
    pytest.mark.skipif(compiler() not in (None, COMPILER), reason=f"avr-gcc is not {COMPILER}"),
]


def test_it_fits_and_its_size_is_in_the_documents(built: str) -> None:
    found = re.search(r"glove: flash (\d+) B, RAM (\d+) B\n", built)
    assert found, built
    flash, ram = int(found[1]), int(found[2])
    assert flash < FLASH / 2
    assert ram + STACK < RAM
    said = f"{flash} B of flash and {ram} B of RAM"
    assert said in (ROOT / "docs" / "glove-protocol.md").read_text(), f"docs/glove-protocol.md: {said}"


def test_the_firmware_that_ships_is_built_from_its_source(built: str) -> None:  # noqa: ARG001
    shipped, fresh = FOLDER / "glove.hex", ROOT / "build" / "firmware" / "glove.hex"
    assert shipped.read_bytes() == fresh.read_bytes(), f"cp {fresh} {shipped}"
