"""What is built: its size, and that the firmware in the repository is built from the source beside it."""

import re

import pytest

from tests.chip.simulated_chip import ROOT

pytestmark = pytest.mark.chip

FOLDER = ROOT / "glove_bridge" / "firmware"
FLASH, RAM = 32_256, 2_048
"""Of an Arduino UNO: the bootloader has the last 512 B of flash."""
STACK = 1_024
"""RAM that is left to the stack at least."""


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
