"""`python -m human_relay`: broadcasts one hand to the swarm. Publish-only: it subscribes to nothing."""

import argparse
import sys
from contextlib import closing

from human_relay.loop import run
from human_relay.orders import OrderReader
from human_relay.sources import open_source
from human_relay.sources.base import HandSource
from human_relay.sources.takeover import open_takeover
from shared.bus import join
from shared.clock import system_clock
from shared.errors import SwarmTouchError
from shared.net.keyring import hand_signer
from shared.nodes import RELAY
from shared.process import add_process_arguments, explain, prepare_process
from shared.scenario_check.checked import open_checked

_EXAMPLE = """example: python -m human_relay --scenario rhombus --hand "scripted:tour?peak=0.4"
Orders are lines on standard input: fly, hold, land, stop (stop is final)."""


def main() -> int:
    """Runs the relay until SIGTERM or SIGINT; returns the exit code."""
    arguments = _parse()
    stopping = prepare_process(RELAY, verbose=arguments.verbose)
    clock = system_clock()
    try:
        scenario, formation = open_checked(arguments.scenario, arguments.set)
        with (
            join(scenario, formation, RELAY, audited=True) as bus,
            closing(_open_hand(arguments, clock())) as source,
        ):
            orders = OrderReader(sys.stdin.fileno() if sys.stdin else None)
            run(
                source,
                orders.wait,
                bus,
                clock,
                stopping,
                hand_signer(scenario.net),
                scenario.rates.hand_hz,
            )
    except SwarmTouchError as error:
        return explain("relay", error)
    return 0


def _open_hand(arguments: argparse.Namespace, start_ns: int) -> HandSource:
    if arguments.takeover is None:
        return open_source(arguments.hand, start_ns)
    return open_takeover(arguments.hand, arguments.takeover, start_ns)


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m human_relay",
        description=__doc__,
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_process_arguments(parser)
    parser.add_argument("--hand", default="scripted:tour", help="URI of the hand source (%(default)s)")
    parser.add_argument("--takeover", metavar="URI", help="a pointer that may take the hand over: pointer://")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
