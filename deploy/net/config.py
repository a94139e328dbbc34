"""`swarmtouch net config`: Zenoh's configuration of one node, written out."""

import argparse
import json

from shared.config import load_scenario
from shared.errors import ConfigError
from shared.formation import build_formation
from shared.net.settings import node_settings
from shared.nodes import all_nodes


def run(arguments: argparse.Namespace) -> int:
    """Prints the configuration of the node's Zenoh session as JSON."""
    profile = [f'net.profile="{arguments.profile}"'] if arguments.profile else []
    scenario = load_scenario(arguments.scenario, (*profile, *arguments.overrides))
    formation = build_formation(scenario, arguments.scenario)
    if arguments.node not in all_nodes(formation):
        raise ConfigError(f"--node {arguments.node}: no such node; nodes: {', '.join(all_nodes(formation))}")
    print(json.dumps(node_settings(scenario, formation, arguments.node), indent=2))
    return 0
