"""`swarmtouch doctor`: whether this machine can fly."""

import argparse

from deploy.cli.arguments import add_overrides

DESCRIPTION = """Looks at Python, packages, ports, a real link, multicast, keys, serial devices and permissions,
the clock and the processor; each with what to do. Exit code 0: a swarm can fly here; 1: it cannot."""
EXAMPLE = "swarmtouch doctor grid --set formation.n=16"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments."""
    parser.add_argument("scenario", nargs="?", default="rhombus", help="what is to fly (default: %(default)s)")
    add_overrides(parser)


def run(arguments: argparse.Namespace) -> int:
    """Looks and returns the exit code."""
    from deploy.doctor.examine import examine  # noqa: PLC0415  --help must not load the bus
    from deploy.doctor.finding import Verdict  # noqa: PLC0415
    from deploy.doctor.show import findings_table  # noqa: PLC0415
    from deploy.terminal.console import open_console  # noqa: PLC0415
    from shared.config import load_scenario  # noqa: PLC0415

    findings = list(examine(load_scenario(arguments.scenario, arguments.overrides)))
    open_console(stderr=False).print(findings_table(findings))
    return 1 if any(finding.verdict is Verdict.BAD for finding in findings) else 0
