"""Two members of a swarm: `python -m tests.chaos.joiner SCENARIO DRONE [JOINS]`.

Drone 1 stays: it says again on its own key what it has heard last of the other. Drone 2 joins so many times,
each time with a word of its own, and prints a line with the seconds until that word has come back: by then it
has been heard, and has heard.
"""

import sys
import time

from shared.bus import join
from shared.clock import system_clock
from shared.config import load_scenario
from shared.formation import build_formation
from shared.nodes import drone_node
from shared.scenario import Scenario
from shared.topics import DRONE_STATE
from shared.transport import Inbox

PERIOD_S = 1 / 60
LIMIT_S = 30.0
STAYS, JOINS = 1, 2


def stay(scenario: Scenario) -> None:
    """Echoes until killed."""
    inbox = Inbox(system_clock())
    with join(scenario, build_formation(scenario), drone_node(STAYS)) as bus:
        bus.subscribe(DRONE_STATE.key(id=JOINS), inbox)
        say, word = bus.publisher(DRONE_STATE, id=STAYS), b""
        print("ready", flush=True)
        while True:
            for arrivals in inbox.take().values():
                word = arrivals[-1].payload
            say(word)
            time.sleep(PERIOD_S)


def join_once(scenario: Scenario, word: bytes) -> float | None:
    """Returns how long it took to be heard and to hear, s; None if it did not happen in time."""
    inbox = Inbox(system_clock())
    start = time.monotonic()
    with join(scenario, build_formation(scenario), drone_node(JOINS)) as bus:
        bus.subscribe(DRONE_STATE.key(id=STAYS), inbox)
        say = bus.publisher(DRONE_STATE, id=JOINS)
        while (elapsed := time.monotonic() - start) < LIMIT_S:
            say(word)
            inbox.wait(PERIOD_S)
            if any(arrival.payload == word for arrivals in inbox.take().values() for arrival in arrivals):
                return elapsed
            time.sleep(PERIOD_S)
    return None


def main() -> None:
    """Stays, or joins again and again."""
    scenario = load_scenario(sys.argv[1])
    if int(sys.argv[2]) == STAYS:
        stay(scenario)
    for number in range(int(sys.argv[3])):
        print(join_once(scenario, b"word %d" % number), flush=True)


if __name__ == "__main__":
    main()
