"""A guest of the mesh that talks too much: `python -m tests.chaos.intruder SWARM HZ SECONDS ENDPOINT...`

It sends garbage on every key that drones listen to: random bytes, or a copy of what it has heard, cut short.
"""

import random
import sys
import time

from shared.bus import ZenohBus
from shared.clock import system_clock
from shared.net.settings import peer_settings
from shared.topics import DRONE_STATE, HAND
from shared.transport import Inbox

DRONES = range(1, 9)


def main() -> None:
    """Talks for so many seconds."""
    swarm, hz, seconds, *endpoints = sys.argv[1:]
    chance = random.Random(0)
    with ZenohBus(peer_settings(swarm, "", endpoints)) as bus:
        inbox = Inbox(system_clock())
        bus.subscribe(HAND.key(), inbox)
        voices = [bus.publisher(HAND), *(bus.publisher(DRONE_STATE, id=drone) for drone in DRONES)]
        heard = b""
        start, said = time.monotonic(), 0
        while (elapsed := time.monotonic() - start) < float(seconds):
            for arrivals in inbox.take().values():
                heard = arrivals[-1].payload
            while said < elapsed * float(hz):
                noise = chance.randbytes(chance.randrange(300))
                voices[said % len(voices)](chance.choice((noise, heard[: chance.randrange(len(heard) + 1)])))
                said += 1
            time.sleep(0.001)
    print(said)


if __name__ == "__main__":
    main()
