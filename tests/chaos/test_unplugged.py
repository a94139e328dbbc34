"""A radio's interface goes and comes back: nobody crashes, and everybody finds the group again."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.chaos.lab import obstacle

pytestmark = [pytest.mark.container, pytest.mark.timeout(150)]

ROOT = Path(__file__).resolve().parents[2]


def test_a_radio_outlives_its_interface() -> None:
    if reason := obstacle():
        pytest.skip(reason)
    command = ("/usr/bin/env", "unshare", "--net", sys.executable, "-m", "tests.chaos.unplugged")
    done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("back") == 3
    assert "\n0 unsent" not in done.stdout
    assert "cannot send" in done.stderr
