"""What holds for every test."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from shared.compiled import form

# A busy machine is no failure: how long an example takes is not what these tests are about.
settings.register_profile("swarmtouch", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("swarmtouch")


def pytest_report_header() -> str:
    return f"law: {form()} {form().reason}"


@pytest.fixture
def short_path() -> Iterator[Path]:
    """A folder whose path leaves room for the name of a Unix socket, which `tmp_path` need not."""
    with tempfile.TemporaryDirectory(prefix="st-") as made:
        yield Path(made)
