"""A radio whose interface goes and comes back: `unshare --net python -m tests.chaos.unplugged`, as root.

Exit code 0: whoever speaks and whoever listens have found each other again, each time.
"""

import subprocess
import time
from collections.abc import Callable
from contextlib import closing

from shared.clock import system_clock
from shared.radio import Receiver, Transmitter
from shared.radio_link import GROUP, PORT, RadioGroup
from shared.topics import HAND
from shared.transport import Inbox

INTERFACE, PEER = "radio0", "radio1"
DEADLINE_S = 20.0
RELAY = "relay/0"


def ip(*arguments: str) -> None:
    """Configures this namespace."""
    subprocess.run(["/usr/bin/env", "ip", *arguments], check=True)


def plug(address: str) -> None:
    """Makes the interface."""
    ip("link", "add", INTERFACE, "type", "veth", "peer", "name", PEER)
    ip("link", "set", PEER, "up")
    ip("address", "add", address, "dev", INTERFACE)
    ip("link", "set", INTERFACE, "up")


def main() -> None:
    """Takes the interface down, away, and its address from it, and speaks meanwhile."""
    plug("10.9.0.1/24")
    clock = system_clock()
    group = RadioGroup(GROUP, PORT, INTERFACE)
    inbox, seen = Inbox(clock), [False]
    with (
        Transmitter(group, "s", clock) as transmitter,
        closing(Receiver(group, "s", RELAY, [HAND.key()], clock)) as receiver,
    ):
        receiver.subscribe(HAND.key(), inbox)
        receiver.watch_presence(lambda _, present: seen.append(present))
        say = transmitter.publisher(HAND)

        def until(what: str, condition: Callable[[], bool]) -> None:
            start = time.monotonic()
            while not condition():
                say(b"")
                time.sleep(1 / 60)
                assert time.monotonic() - start < DEADLINE_S, what
            print(f"{what} after {time.monotonic() - start:.2f} s")

        def heard() -> bool:
            return bool(inbox.take())

        until("heard", heard)
        ip("link", "set", INTERFACE, "down")
        until("gone with the link", lambda: not seen[-1])
        ip("link", "set", INTERFACE, "up")
        until("back", lambda: heard() and seen[-1])
        ip("link", "del", INTERFACE)
        until("gone with the interface", lambda: not seen[-1])
        plug("10.9.0.1/24")
        until("back", lambda: heard() and seen[-1])
        ip("address", "del", "10.9.0.1/24", "dev", INTERFACE)
        ip("address", "add", "10.9.0.7/24", "dev", INTERFACE)
        until("back under another address", heard)
        print(f"{transmitter.audit()['unsent']:.0f} unsent")


if __name__ == "__main__":
    main()
