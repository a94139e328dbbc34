"""`python -m observer`: records everything that a swarm says; commands nobody."""

import argparse
import os
import sys
from pathlib import Path

from observer.swarm import open_observer
from observer.trace.record import INBOX_DEPTH, run
from observer.trace.write import TraceWriter
from shared.clock import system_clock
from shared.config import load_scenario
from shared.errors import SwarmTouchError
from shared.nodes import OBSERVER
from shared.process import add_process_arguments, explain, prepare_process
from shared.transport import Inbox

NICENESS = 5
"""Who flies goes first. What is said meanwhile waits at the senders (`shared.net.settings.STATES_QUEUED`)."""
_EXAMPLE = "example: python -m observer --scenario rhombus --run-dir runs/mine"


def main() -> int:
    """Records until SIGTERM or SIGINT; returns the exit code."""
    arguments = _parse()
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    stopping = prepare_process(OBSERVER, verbose=arguments.verbose)
    clock = system_clock()
    try:
        scenario = load_scenario(arguments.scenario, arguments.set)
        writer = TraceWriter(arguments.run_dir, scenario)
        with open_observer(scenario) as bus:
            run(writer, bus, Inbox(clock, INBOX_DEPTH), clock, stopping)
    except SwarmTouchError as error:
        return explain(OBSERVER, error)
    return 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m observer", description=__doc__, epilog=_EXAMPLE)
    add_process_arguments(parser)
    parser.add_argument("--run-dir", type=Path, required=True, help="where to put the trace")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
