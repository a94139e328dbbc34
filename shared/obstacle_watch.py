"""Who moves among the drones, as heard: the newest valid word about every moving obstacle. Pure."""

from typing import NamedTuple

from shared.errors import DecodeError
from shared.messages import ObstacleState
from shared.order import check_newer
from shared.plausibility import HAND_LIMITS, Believed, believe
from shared.topics import OBSTACLE

MOST_OBSTACLES = 64
"""Whoever says that there are more is not listened to."""


class _Known(NamedTuple):
    state: ObstacleState
    arrival_ns: int
    believed: Believed


class ObstacleWatch:
    """The newest word about every moving obstacle.

    One that jumps further than a hand could is not believed: it stays where it was until there was time enough.
    """

    def __init__(self) -> None:
        self._known: dict[int, _Known] = {}

    def hear(self, number: int, state: ObstacleState, arrival_ns: int) -> None:
        """Takes a state in.

        Args:
            number: Of the obstacle, as its key says.
            state: What was said.
            arrival_ns: When it came, on the own clock.

        Raises:
            DecodeError: It speaks for another one, is not newer, cannot be, or is one too many.
        """
        if state.id != number:
            raise DecodeError("wrong-id", f"obstacle {state.id} as number {number}")
        known = self._known.get(number)
        if known is None:
            self._forget_old(arrival_ns)
            if len(self._known) >= MOST_OBSTACLES:
                raise DecodeError("too-many-obstacles", f"more than {MOST_OBSTACLES}")
        else:
            was = known.state
            newest = (was.epoch, was.seq, known.arrival_ns)
            check_newer((state.epoch, state.seq, arrival_ns), newest, OBSTACLE.stale_s)
        before = None if known is None else known.believed
        believed = believe(before, state.position, state.velocity, arrival_ns, HAND_LIMITS)
        self._known[number] = _Known(state, arrival_ns, believed)

    def present(self, now_ns: int) -> list[tuple[ObstacleState, float]]:
        """Returns every obstacle that may be relied on to be there, and how long ago it was heard, s."""
        if not self._known:
            return []
        ages = [(known.state, (now_ns - known.arrival_ns) * 1e-9) for known in self._known.values()]
        return [(state, age) for state, age in ages if age <= state.valid_s]

    def _forget_old(self, now_ns: int) -> None:
        valid = {state.id for state, _ in self.present(now_ns)}
        self._known = {number: known for number, known in self._known.items() if number in valid}
