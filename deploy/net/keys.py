"""`swarmtouch net keys init | issue | remove | show`: the keys of a swarm."""

import argparse
import datetime
from pathlib import Path
from urllib.parse import urlsplit

from rich.table import Table

from deploy.net.authority import WARN_DAYS, create, issue, issued, remove
from deploy.terminal.console import open_console
from shared.config import load_scenario
from shared.errors import ConfigError
from shared.formation import Formation, build_formation
from shared.net.keyring import Keyring
from shared.nodes import all_nodes, endpoint
from shared.scenario import Scenario


def run(arguments: argparse.Namespace) -> int:
    """Does what was asked and returns the exit code."""
    keyring = Keyring(Path(arguments.keys))
    scenario = load_scenario(arguments.scenario, arguments.overrides)
    if arguments.action == "init":
        create(keyring, scenario.swarm.name)
        print(
            f"{keyring.folder}: authority and hand key made; {keyring.authority_key} never leaves this machine"
        )
    elif arguments.action == "issue":
        formation = build_formation(scenario, arguments.scenario)
        for node in arguments.nodes or all_nodes(formation):
            issue(keyring, node, (*arguments.host, *_hosts(scenario, formation, node)))
            print(f"{keyring.certificate(node)}: issued for {node}")
    elif arguments.action == "remove":
        for node in arguments.nodes:
            remove(keyring, node)
            print(f"{node} is no member any more; copy members.toml to every node and restart them")
    else:
        return _show(keyring)
    return 0


def _hosts(scenario: Scenario, formation: Formation, node: str) -> tuple[str, ...]:
    """Returns the host under which the scenario has others dial a node."""
    address = endpoint(scenario, formation, node) if node in all_nodes(formation) else ""
    try:
        host = urlsplit(f"//{address.partition('/')[2]}").hostname if address else None
    except ValueError as error:
        raise ConfigError(f"net.endpoints.{node}: {address!r}: {error}") from error
    return (host,) if host else ()


def _show(keyring: Keyring) -> int:
    table = Table("node", "member", "private key here", "dialled as", "expires", box=None)
    now = datetime.datetime.now(datetime.UTC)
    worst = 0
    for each in issued(keyring):
        left = each.days_left(now)
        worst = max(worst, left < WARN_DAYS)
        note = f"{each.expires:%Y-%m-%d} ({left} days{', issue it again' if left < WARN_DAYS else ''})"
        yes = ("yes" if each.is_member else "-", "yes" if each.has_key else "no")
        table.add_row(each.name, *yes, ", ".join(each.hosts) or "-", note)
    open_console(stderr=False).print(table)
    return worst
