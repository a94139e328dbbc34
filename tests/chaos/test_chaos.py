"""A few of the plans, each with a fault of another kind; `make chaos` flies all."""

from pathlib import Path

import pytest

from tests.chaos.lab import obstacle
from tests.chaos.links import bad_weather
from tests.chaos.plans import PLANS
from tests.chaos.steps import Fly

pytestmark = [pytest.mark.container, pytest.mark.timeout(180)]


@pytest.mark.parametrize(
    "fly",
    [
        *(
            pytest.param(PLANS[name], id=name)
            for name in ("kill-1", "restart", "kill-router", "freeze", "part", "garbage", "clock", "disk")
        ),
        pytest.param(bad_weather(13.0), id="weather"),
    ],
)
def test_the_swarm_does_as_designed(fly: Fly, tmp_path: Path) -> None:
    if reason := obstacle():
        pytest.skip(reason)
    row = fly(tmp_path / "flight")
    assert row.failures == (), row
