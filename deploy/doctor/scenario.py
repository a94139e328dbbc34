"""Whether the values of the scenario go together."""

from collections.abc import Iterator

from deploy.doctor.finding import Finding, bad, good
from shared.formation import Formation
from shared.scenario import Scenario
from shared.scenario_check.check import check_scenario


def check_values(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    """Yields one row per thing that does not go together."""
    findings = list(check_scenario(scenario, formation))
    for finding in findings:
        yield bad(f"scenario: {finding.key}", finding.what, finding.advice)
    if not findings:
        yield good("scenario", "its values go together")
