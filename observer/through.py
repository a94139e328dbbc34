"""Which hand sample has come through every hop of the reference path to a state. Pure."""

from collections.abc import Callable, Mapping

from observer.hand_log import HandLog
from shared.messages import DroneState, Heard
from shared.topics import HAND

HAND_KEY = HAND.key()


def newest_through(
    state: DroneState,
    hands: HandLog | None,
    references: Mapping[str, int],
    through: Callable[[int, Heard], int | None],
) -> int | None:
    """Returns the number of the newest such sample, None if there is none.

    Args:
        state: The state.
        hands: Every hand sample up to now; None if the drone does not refer to the human.
        references: Key -> number of the drones that it refers to.
        through: Returns the same of a reference's state, by its number and what was heard.
    """
    paths = [through(drone, heard) for key, drone in references.items() if (heard := state.heard.get(key))]
    if hands is not None and HAND_KEY in state.heard:
        paths.append(hands.number(state.heard[HAND_KEY]))
    return max((path for path in paths if path is not None), default=None)
