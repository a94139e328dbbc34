"""`python -m glove_bridge`: listens to the swarm and makes the operator feel it."""

import argparse
import sys
from contextlib import closing

from glove_bridge.bridge import Bridge
from glove_bridge.gloves import open_glove
from glove_bridge.loop import run
from glove_bridge.patterns import CUES, load_patterns
from shared.bus import join
from shared.clock import system_clock
from shared.config import load_scenario
from shared.errors import SwarmTouchError
from shared.formation import build_formation
from shared.nodes import BRIDGE
from shared.process import add_process_arguments, explain, prepare_process
from shared.transport import Inbox

_EXAMPLE = "example: python -m glove_bridge --scenario rhombus --glove terminal:// --patterns flight"


def main() -> int:
    """Runs the bridge until SIGTERM or SIGINT; returns the exit code."""
    arguments = _parse()
    stopping = prepare_process(BRIDGE, verbose=arguments.verbose)
    clock = system_clock()
    try:
        scenario = load_scenario(arguments.scenario, arguments.set)
        formation = build_formation(scenario, arguments.scenario)
        patterns, cues = load_patterns(arguments.patterns), load_patterns(CUES)
        bridge = Bridge(scenario, formation, patterns, cues, clock())
        with (
            closing(open_glove(arguments.glove)) as glove,
            join(scenario, formation, BRIDGE, audited=True) as bus,
        ):
            run(bridge, glove, bus, Inbox(clock), clock, stopping)
    except SwarmTouchError as error:
        return explain(BRIDGE, error)
    return 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m glove_bridge", description=__doc__, epilog=_EXAMPLE)
    add_process_arguments(parser)
    parser.add_argument("--glove", default="none://", help="URI of the glove (%(default)s)")
    parser.add_argument("--patterns", default="paper", help="pattern set: name or TOML file (%(default)s)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
