"""The law compiled and not: the same source, the same flights to the last bit."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from shared.compiled import PURE, form

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.slow


def flown(**environment: str) -> tuple[str, dict[str, str]]:
    done = subprocess.run(
        [sys.executable, "-m", "tests.forms_flown"],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    name, *lines = done.stdout.splitlines()
    return name, dict(line.rsplit(": ", 1) for line in lines)


@pytest.mark.timeout(360)
def test_both_forms_fly_the_same_to_the_last_bit() -> None:
    if not form().digest:
        pytest.skip(f"only the pure form here ({form().reason}): nothing to compare; make compile")
    (compiled, those), (pure, these) = flown(**{PURE: "0"}), flown(**{PURE: "1"})
    assert compiled == str(form())
    assert pure == "pure"
    assert len(these) > 25
    assert those == these
