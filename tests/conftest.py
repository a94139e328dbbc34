"""What holds for every test."""

from hypothesis import HealthCheck, settings

from shared.compiled import form

# A busy machine is no failure: how long an example takes is not what these tests are about.
settings.register_profile("swarmtouch", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("swarmtouch")


def pytest_report_header() -> str:
    return f"law: {form()} {form().reason}"
