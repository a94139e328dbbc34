"""What holds for every test."""

import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from shared.compiled import form

# A busy machine is no failure: how long an example takes is not what these tests are about.
settings.register_profile("swarmtouch", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("swarmtouch")

LAW = re.compile(
    r"^(?:from|import) (?:agents\.(?:agent|control|settings|vehicles\.bodies)|deploy\.(?:falsify|lockstep)"
    r"|shared\.cells)\b",
    re.MULTILINE,
)
"""Imports the law, or what drives it in one process."""


def pytest_report_header() -> str:
    return f"law: {form()} {form().reason}"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks the tests that are about the law, by what they import; CI runs them in both its forms."""
    of_law = {
        path: bool(LAW.search(path.read_text(encoding="utf-8"))) for path in {item.path for item in items}
    }
    for item in items:
        if of_law[item.path]:
            item.add_marker("law")


@pytest.fixture
def short_path() -> Iterator[Path]:
    """A folder whose path leaves room for the name of a Unix socket, which `tmp_path` need not."""
    with tempfile.TemporaryDirectory(prefix="st-") as made:
        yield Path(made)
