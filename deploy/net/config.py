"""`swarmtouch net config`: Zenoh's configuration of one node, written out."""

import argparse
import json

from shared.config import load_scenario
from shared.errors import ConfigError
from shared.formation import build_formation
from shared.net.settings import node_settings
from shared.nodes import all_nodes


def run(arguments: argparse.Namespace) -> int:
    """Prints one JSON object per Zenoh session of the node, the one that it publishes on first."""
    profile = [f'net.profile="{arguments.profile}"'] if arguments.profile else []
    scenario = load_scenario(arguments.scenario, (*profile, *arguments.overrides))
    formation = build_formation(scenario, arguments.scenario)
    if arguments.node not in all_nodes(formation):
        raise ConfigError(f"--node {arguments.node}: no such node; nodes: {', '.join(all_nodes(formation))}")
    for settings in node_settings(scenario, formation, arguments.node):
        print(json.dumps(settings, indent=2))
    return 0
