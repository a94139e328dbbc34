"""Two members of a swarm: `python -m tests.chaos.joiner SCENARIO DRONE`, until killed.

Drone 1 says again on its own key what it has heard last of the other. Drone 2 joins, says a word of its own,
and prints how many seconds it took until that word came back: by then it has been heard, and has heard.
"""

import sys
import time

from shared.bus import join
from shared.clock import system_clock
from shared.config import load_scenario
from shared.formation import build_formation
from shared.nodes import drone_node
from shared.topics import DRONE_STATE
from shared.transport import Inbox

PERIOD_S = 1 / 60
STAYS, JOINS = 1, 2


def main() -> None:
    """Joins as one of the two and talks to the other."""
    drone = int(sys.argv[2])
    scenario, inbox = load_scenario(sys.argv[1]), Inbox(system_clock())
    start_ns = time.monotonic_ns()
    word = b"" if drone == STAYS else b"%d" % start_ns
    with join(scenario, build_formation(scenario), drone_node(drone)) as bus:
        bus.subscribe(DRONE_STATE.key(id=STAYS + JOINS - drone), inbox)
        say, told = bus.publisher(DRONE_STATE, id=drone), False
        while True:
            say(word)
            time.sleep(PERIOD_S)
            for arrivals in inbox.take().values():
                heard = arrivals[-1].payload
                if drone == STAYS:
                    word = heard
                elif heard == word and not told:
                    told = True
                    print((time.monotonic_ns() - start_ns) / 1e9, flush=True)


if __name__ == "__main__":
    main()
