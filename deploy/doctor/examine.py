"""Every check, in the order in which things go wrong."""

import datetime
from collections.abc import Iterator

from deploy.doctor.finding import Finding
from deploy.doctor.hardware import all_hardware
from deploy.doctor.keys import check_keys
from deploy.doctor.network import all_network
from deploy.doctor.scenario import check_values
from deploy.doctor.software import all_software
from shared.formation import build_formation
from shared.scenario import Scenario


def examine(scenario: Scenario) -> Iterator[Finding]:
    """Looks at everything that flying a scenario on this machine needs."""
    formation = build_formation(scenario)
    yield from all_software()
    yield from check_values(scenario, formation)
    yield from all_network(scenario)
    yield from check_keys(scenario, datetime.datetime.now(datetime.UTC))
    yield from all_hardware(len(formation.ids))
