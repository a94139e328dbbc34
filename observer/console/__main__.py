"""`python -m observer.console`: a live page of the swarm, which may also be its hand."""

import argparse
import sys
from pathlib import Path

from observer.console.console import ROLE
from observer.console.serve import PORT, RANDOM_TOKEN, TOKEN_VARIABLE, Options, serve
from shared.config import load_scenario
from shared.errors import SwarmTouchError
from shared.pointer_link import LOOPBACK
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


def add_console_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares where and how to serve."""
    parser.add_argument("--host", default=LOOPBACK, help="address to bind; others want a token (%(default)s)")
    parser.add_argument("--port", type=int, default=PORT, help="TCP port, 0 for any free one (%(default)s)")
    parser.add_argument(
        "--token",
        metavar="CHOICE",
        help=f"{RANDOM_TOKEN} or @FILE: what a page must know (default: {TOKEN_VARIABLE}, or nothing)",
    )
    parser.add_argument(
        "--tls", type=Path, metavar="DIR", help="HTTPS with DIR/cert.pem and key.pem, made if they are missing"
    )


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m observer.console", description=__doc__, epilog=_EXAMPLE)
    add_process_arguments(parser)
    parser.add_argument("--patterns", type=Path, metavar="FILE", help="frames of the glove's patterns (JSON)")
    add_console_arguments(parser)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
