"""`swarmtouch net`: keys of a swarm, and Zenoh's configuration of any node."""

import argparse

from deploy.cli.arguments import add_scenario_arguments
from deploy.net import FOLDER

DESCRIPTION = """keys: makes the swarm's own certificate authority, issues a certificate per node, removes one,
shows them all. config: writes the Zenoh configuration of any node in any profile, as its process uses it."""
EXAMPLE = """swarmtouch net keys init rhombus
         swarmtouch net keys issue rhombus
         swarmtouch up rhombus --set net.profile=field --set net.keys=keys
         swarmtouch net keys remove rhombus drone/3
         swarmtouch net config rhombus --profile field --node drone/2"""

ACTIONS = {
    "init": "make the authority and the hand's signing key",
    "issue": "issue certificates, to every node of the scenario unless some are named",
    "remove": "strike nodes from the members",
    "show": "list the certificates; exit code 1 if one ends within 30 days",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments."""
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="keys | config")
    actions = kinds.add_parser("keys", help="the keys of a swarm").add_subparsers(
        dest="action", required=True, metavar="ACTION"
    )
    for name, summary in ACTIONS.items():
        action = actions.add_parser(name, help=summary, description=summary)
        add_scenario_arguments(action)
        action.add_argument(
            "--keys", default=FOLDER, metavar="DIR", help="where keys lie (default: %(default)s)"
        )
        if name in ("issue", "remove"):
            many = "*" if name == "issue" else "+"
            action.add_argument("nodes", nargs=many, metavar="NODE", help="for example drone/2")
        if name == "issue":
            action.add_argument(
                "--host",
                action="append",
                default=[],
                metavar="HOST",
                help="further name or address of the node",
            )
    config = kinds.add_parser("config", help="Zenoh's configuration of a node, as JSON")
    add_scenario_arguments(config)
    config.add_argument("--profile", choices=("laptop", "compose", "field", "radio"), help="as net.profile")
    config.add_argument("--node", required=True, help="for example drone/2, relay, bridge, observer")


def run(arguments: argparse.Namespace) -> int:
    """Does it and returns the exit code."""
    if arguments.kind == "keys":
        from deploy.net.keys import run as keys  # noqa: PLC0415  only keys need cryptography

        return keys(arguments)
    from deploy.net.config import run as config  # noqa: PLC0415  --help must not load the formation

    return config(arguments)
