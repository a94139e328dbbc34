"""A router that every node may be a client of: `python -m deploy.router --listen tcp/0.0.0.0:7447`.

For networks in which nodes cannot reach each other, only one place in the middle. While it is down nobody hears
anybody: every drone extrapolates, holds and, after 10 s, lands.
"""

import argparse
import sys

from shared.bus import routing
from shared.errors import SwarmTouchError
from shared.process import explain, prepare_process
from shared.watchdog import feed_watchdog

PERIOD_S = 1.0


def main() -> int:
    """Routes until SIGTERM or SIGINT; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m deploy.router", description=__doc__)
    parser.add_argument("--listen", default="tcp/0.0.0.0:7447", help="Zenoh endpoint (%(default)s)")
    listen = parser.parse_args().listen
    stopping = prepare_process("router")
    try:
        with routing(listen):
            while not stopping.wait(PERIOD_S):
                feed_watchdog()
    except SwarmTouchError as error:
        return explain("router", error)
    return 0


if __name__ == "__main__":
    sys.exit(main())
