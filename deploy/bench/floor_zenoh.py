"""A bare node over Zenoh: the bus of the product with nothing but a `Hop` behind it.

It answers on the thread that delivers, so no second thread has to wake up: no agent on this bus can be faster.
"""

import argparse
import sys
import threading

from deploy.bench.hop import HAND_ID, Hop
from deploy.bench.metronome import tick
from shared.bus import ZenohBus
from shared.clock import Clock, system_clock
from shared.errors import SwarmTouchError
from shared.net.settings import peer_settings
from shared.process import explain, prepare_process
from shared.topics import DRONE_STATE, HAND
from shared.transport import Inbox, Publish


class AnsweringInbox(Inbox):
    """Keeps nothing: every payload goes to the hop at once, and its answer out.

    Args:
        hop: The node.
        publish: Sends its answers.
        clock: The process's clock.
    """

    def __init__(self, hop: Hop, publish: Publish, clock: Clock) -> None:
        super().__init__(clock)
        self._hop, self._publish, self._now = hop, publish, clock
        self._turn = threading.Lock()

    def put(self, key: str, payload: bytes) -> None:
        """See `Inbox.put`; every subscription calls it on a thread of its own."""
        del key
        arrival_ns = self._now()
        with self._turn:
            answer = self._hop.hear(payload, arrival_ns, self._now)
        if answer is not None:
            self._publish(answer)


def main() -> int:
    """Runs one node until SIGTERM or SIGINT."""
    args = _parse()
    stopping = prepare_process(f"bare/{args.node}")
    clock = system_clock()
    try:
        bus = ZenohBus(peer_settings(args.swarm, args.listen, args.connect))
    except SwarmTouchError as error:
        return explain("floor_zenoh", error)
    with bus:
        if args.node == HAND_ID:
            bus.announce("relay", 0)
            tick(bus.publisher(HAND), args.bytes, args.hz, clock, stopping)
            return 0
        inbox = AnsweringInbox(
            Hop(args.node, args.reference, args.bytes), bus.publisher(DRONE_STATE, id=args.node), clock
        )
        for key in args.hear:
            bus.subscribe(key, inbox)
        bus.announce("drone", args.node)
        stopping.wait()
    return 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m deploy.bench.floor_zenoh",
        description=__doc__,
        epilog="example: python -m deploy.bench.floor_zenoh --node 1 --reference 0 --bytes 99",
    )
    parser.add_argument("--node", type=int, required=True, help="number of the drone, 0 for the hand")
    parser.add_argument("--bytes", type=int, required=True, help="size of what it sends")
    parser.add_argument("--reference", type=int, action="append", default=[], help="node that it waits for")
    parser.add_argument("--hear", action="append", default=[], metavar="KEY", help="key to subscribe to")
    parser.add_argument("--hz", type=float, default=60.0, help="rate of the hand (default: %(default)s)")
    parser.add_argument("--swarm", default="floor", help="prefix of every key (default: %(default)s)")
    parser.add_argument("--listen", default="", help="own endpoint")
    parser.add_argument("--connect", action="append", default=[], help="endpoint to dial")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
