"""A short search of fixed seeds over every scenario, body and law that ships: no limit of any class is broken.

Each case draws size, columns, link-loss rule, hand, faults and weather anew (docs/falsify.md).
"""

import itertools

import pytest

from deploy.falsify.draw import Plan
from deploy.falsify.search import Budget, search
from deploy.falsify.swarm import prepare
from shared.config import SCENARIOS
from shared.errors import ConfigError

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

FLIGHTS, SEED = 3, 1
BODIES, LAWS = ("identified", "crazyflie"), ("paper", "stable")
SHIPPED = sorted(path.stem for path in SCENARIOS.glob("*.toml"))


def chosen(body: str, law: str) -> tuple[str, ...]:
    return (f"vehicles.all.body={body}", f"swarm.law={law}")


def flies(scenario: str, body: str, law: str) -> bool:
    """Says whether a scenario takes a body and a law: the paper's is refused beyond four hops."""
    try:
        prepare(scenario, chosen(body, law))
    except ConfigError:
        return False
    return True


@pytest.mark.parametrize(
    ("scenario", "body", "law"),
    [each for each in itertools.product(SHIPPED, BODIES, LAWS) if flies(*each)],
)
def test_a_short_search_breaks_no_limit(scenario: str, body: str, law: str) -> None:
    finds = search(
        Plan(scenarios=(scenario,), overrides=chosen(body, law), vary=True),
        Budget(flights=FLIGHTS),
        SEED,
        jobs=1,
    )
    assert finds.flights == FLIGHTS
    worst = {kind: kept[0] for kind, kept in finds.worst.items() if kept and finds.broken[kind]}
    assert not worst, {kind: (find.verdict[kind], find.case) for kind, find in worst.items()}


def test_every_scenario_body_and_law_is_flown() -> None:
    flown = [each for each in itertools.product(SHIPPED, BODIES, LAWS) if flies(*each)]
    for kind, names in enumerate((SHIPPED, BODIES, LAWS)):
        assert {each[kind] for each in flown} == set(names)
