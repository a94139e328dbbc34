"""A bare node over UDP sockets on loopback: no library at all between the nodes."""

import argparse
import socket
import sys

from deploy.bench.hop import HAND_ID, Hop
from deploy.bench.metronome import tick
from shared.clock import system_clock
from shared.process import prepare_process

LOOPBACK = "127.0.0.1"
MAX_DATAGRAM = 8192
_LONGEST_WAIT_S = 0.2


def main() -> int:
    """Runs one node until SIGTERM or SIGINT."""
    args = _parse()
    stopping = prepare_process(f"bare/{args.node}")
    clock = system_clock()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.bind((LOOPBACK, args.port))
        opened.settimeout(_LONGEST_WAIT_S)
        listeners = [(LOOPBACK, port) for port in args.to]

        def publish(payload: bytes) -> None:
            for listener in listeners:
                opened.sendto(payload, listener)

        if args.node == HAND_ID:
            tick(publish, args.bytes, args.hz, clock, stopping)
            return 0
        hop = Hop(args.node, args.reference, args.bytes)
        while not stopping.is_set():
            try:
                payload = opened.recv(MAX_DATAGRAM)
            except TimeoutError:
                continue
            answer = hop.hear(payload, clock(), clock)
            if answer is not None:
                publish(answer)
    return 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m deploy.bench.floor_udp",
        description=__doc__,
        epilog="example: python -m deploy.bench.floor_udp --node 1 --reference 0 --port 9001 --bytes 99",
    )
    parser.add_argument("--node", type=int, required=True, help="number of the drone, 0 for the hand")
    parser.add_argument("--bytes", type=int, required=True, help="size of what it sends")
    parser.add_argument("--reference", type=int, action="append", default=[], help="node that it waits for")
    parser.add_argument("--hz", type=float, default=60.0, help="rate of the hand (default: %(default)s)")
    parser.add_argument("--port", type=int, required=True, help="own port")
    parser.add_argument("--to", type=int, action="append", default=[], help="port of a node that hears it")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
