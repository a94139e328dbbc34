"""A few of the plans, each with a fault of another kind; `make chaos` flies all."""

from pathlib import Path

import pytest

from tests.chaos.lab import obstacle
from tests.chaos.plans import PLANS

pytestmark = [pytest.mark.container, pytest.mark.timeout(180)]


@pytest.mark.parametrize(
    "name",
    [
        "cut-tcp",
        "cut-radio",
        "kill-1",
        "kill-two",
        "restart",
        "kill-router",
        "freeze",
        "unheard",
        "simplex",
        "garbage",
    ],
)
def test_the_swarm_does_as_designed(name: str, tmp_path: Path) -> None:
    if reason := obstacle():
        pytest.skip(reason)
    row = PLANS[name](tmp_path / "flight")
    assert row.failures == (), row
