"""Listens to a swarm just long enough to judge it."""

import time

from deploy.launcher.monitor import Monitor
from deploy.status.report import Heard, Row, expected_processes, rows_of
from observer.swarm import open_observer
from shared.clock import system_clock
from shared.formation import build_formation
from shared.nodes import DRONE
from shared.scenario import Scenario
from shared.vehicles import vehicle_settings

LONGEST_S = 4.0
"""Links come within a second, health once a second."""
_PERIOD_S = 0.05


def listen(scenario: Scenario, only: tuple[str, ...] = (), longest_s: float | None = None) -> list[Row]:
    """Listens until everybody has been heard to be well, at most for a while.

    Args:
        scenario: The resolved scenario of the swarm.
        only: Tokens of the processes that count; empty for all.
        longest_s: How long at most, s; None for `LONGEST_S`.
    """
    formation = build_formation(scenario)
    simulated = any((vehicle_settings(scenario, i).uri or "").startswith("sim:") for i in formation.ids)
    expected = expected_processes(formation.ids, simulated=simulated)
    deadline = time.monotonic() + (LONGEST_S if longest_s is None else longest_s)
    with open_observer(scenario) as bus:
        monitor = Monitor(bus, formation, system_clock())
        while True:
            monitor.drain()
            rows = rows_of(expected, _heard(monitor), only)
            if all(row.well for row in rows) or time.monotonic() >= deadline:
                return rows
            time.sleep(_PERIOD_S)


def _heard(monitor: Monitor) -> dict[str, Heard]:
    states = {f"{DRONE}/{drone}": state for drone, state in monitor.stats.latest.items()}
    present, health = set(monitor.present), monitor.health
    return {
        token: Heard(
            present=token in present,
            status=health[token].status if token in health else None,
            state=states.get(token),
        )
        for token in {*present, *health, *states}
    }
