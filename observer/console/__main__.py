"""`python -m observer.console`: a live page of the swarm, which may also be its hand."""

import argparse
import sys
from pathlib import Path

from observer.console.arguments import add_console_arguments
from observer.console.console import ROLE
from observer.console.serve import Options, serve
from shared.config import load_scenario
from shared.errors import SwarmTouchError
from shared.process import add_process_arguments, explain, prepare_process

_EXAMPLE = "example: python -m observer.console --scenario runs/latest/scenario.toml"


def main() -> int:
    """Serves until SIGTERM or SIGINT; returns the exit code."""
    arguments = _parse()
    stopping = prepare_process(ROLE, verbose=arguments.verbose)
    try:
        options = Options(
            scenario=load_scenario(arguments.scenario, arguments.set),
            patterns=arguments.patterns,
            host=arguments.host,
            port=arguments.port,
            token=arguments.token,
            tls=arguments.tls,
        )
        serve(options, stopping)
    except SwarmTouchError as error:
        return explain(ROLE, error)
    return 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m observer.console", description=__doc__, epilog=_EXAMPLE)
    add_process_arguments(parser)
    parser.add_argument("--patterns", type=Path, metavar="FILE", help="frames of the glove's patterns (JSON)")
    add_console_arguments(parser)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
