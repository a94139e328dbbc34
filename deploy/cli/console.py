"""`swarmtouch console`: the live page for a flight that is already running."""

import argparse
from pathlib import Path

from deploy.cli.arguments import add_run

DESCRIPTION = """Serves a page that shows a running flight: drones, links, health, and the glove's patterns as
light and sound. One page at a time may be the hand, if the flight's hand is pointer:// or it was started with
--console. On another address than 127.0.0.1 the page wants a token; phones tilt only over HTTPS (--tls)."""
EXAMPLE = """swarmtouch console
         swarmtouch console --host 0.0.0.0 --token random --tls runs/tls"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments."""
    from observer.console.arguments import add_console_arguments  # noqa: PLC0415  --help stays quick

    add_run(parser)
    add_console_arguments(parser)
    parser.add_argument("-v", "--verbose", action="store_true", help="log debugging details")


def run(arguments: argparse.Namespace) -> int:
    """Serves until Ctrl-C and returns the exit code."""
    from observer.console.console import ROLE  # noqa: PLC0415  --help must not load the bus
    from observer.console.pattern_file import PATTERN_FILE  # noqa: PLC0415
    from observer.console.serve import Options, serve  # noqa: PLC0415
    from observer.swarm import LATEST, RUNS, running_scenario  # noqa: PLC0415
    from shared.process import prepare_process  # noqa: PLC0415

    scenario = running_scenario(arguments.run)
    patterns = Path(arguments.run or RUNS / LATEST) / PATTERN_FILE
    options = Options(
        scenario=scenario,
        patterns=patterns if patterns.is_file() else None,
        host=arguments.host,
        port=arguments.port,
        token=arguments.token,
        tls=arguments.tls,
    )
    serve(options, prepare_process(ROLE, verbose=arguments.verbose))
    return 0
