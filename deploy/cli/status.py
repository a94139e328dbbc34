"""`swarmtouch status`: one look at a running flight."""

import argparse
import json

from deploy.cli.arguments import add_overrides, add_run

DESCRIPTION = """Listens to a running flight for at most a few seconds and says how every process is. Exit code
0: all that the scenario needs are there and well; 1: not; 2: there is no such flight. Fit for health checks."""
EXAMPLE = """swarmtouch status
         swarmtouch status runs/latest --only drone/2 --json"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments."""
    add_run(parser)
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="PROCESS",
        help="only this one counts, for example drone/2, relay/0, bridge/0; repeatable",
    )
    add_overrides(parser)
    parser.add_argument("--json", action="store_true", help="one line of JSON instead of a table")


def run(arguments: argparse.Namespace) -> int:
    """Looks and returns the exit code."""
    from deploy.status.listen import listen  # noqa: PLC0415
    from deploy.status.show import audit_table, status_json, status_table  # noqa: PLC0415
    from deploy.terminal.console import open_console  # noqa: PLC0415  --help must not load the bus
    from observer.swarm import running_scenario  # noqa: PLC0415

    scenario = running_scenario(arguments.run, arguments.overrides)
    rows = listen(scenario, tuple(arguments.only))
    if arguments.json:
        print(json.dumps(status_json(rows)))
    else:
        tables = status_table(rows, f"swarm {scenario.swarm.name}"), audit_table(rows)
        open_console(stderr=False).print(*filter(None, tables))
    return 0 if all(row.well for row in rows) else 1
