"""A recorded flight, indexed so that hand samples can be followed through it. Pure."""

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from itertools import accumulate

from attrs import field, frozen

from observer.hand_log import HandLog
from observer.through import HAND_KEY, newest_through
from shared.errors import ConfigError
from shared.formation import Formation
from shared.messages import DroneState, FormationState, HandSample, Heard, Message, PatternEvent
from shared.topics import DRONE_STATE

NEVER = -1
"""Where there is no hand sample yet."""

Key = tuple[int, int]
"""(epoch, seq)."""


@frozen(eq=False)
class FlownDrone:
    """The states of one drone, by (epoch, seq).

    Attributes:
        states: Them.
        through: The newest hand sample that came to each state through every hop, `NEVER` before the first.
        direct: The newest that each state used in any way, also as the hand's velocity only.
    """

    states: list[DroneState]
    through: list[int]
    direct: list[int]
    _rows: dict[Key, int] = field(init=False)
    _through_so_far: list[int] = field(init=False)
    _direct_so_far: list[int] = field(init=False)

    @_rows.default
    def _number_rows(self) -> dict[Key, int]:
        return {(state.epoch, state.seq): row for row, state in enumerate(self.states)}

    @_through_so_far.default
    def _accumulate_through(self) -> list[int]:
        return list(accumulate(self.through, max))

    @_direct_so_far.default
    def _accumulate_direct(self) -> list[int]:
        return list(accumulate(self.direct, max))

    def row(self, heard: Heard) -> int | None:
        """Returns the row of a state that somebody heard, None if it was not recorded."""
        return self._rows.get((heard.epoch, heard.seq))

    def first_through(self, number: int) -> int | None:
        """Returns the row of the first state to which a sample, or a newer one, came through every hop."""
        return _first(self._through_so_far, number)

    def first_direct(self, number: int) -> int | None:
        """Returns the row of the first state that used it in any way."""
        return _first(self._direct_so_far, number)


class RecordedFlight:
    """What was said in a flight.

    Args:
        formation: What flew.
        messages: Everything that was recorded.

    Attributes:
        formation: What flew.
        hands: Number -> hand sample; a number is its `seq`, counted on across restarts of the relay.
        drones: Number -> its states.
        started: Patterns that the glove began to play, in that order.
        formation_states: What the glove bridge saw.
    """

    def __init__(self, formation: Formation, messages: Iterable[Message]) -> None:
        self.formation = formation
        self.hands: dict[int, HandSample] = {}
        self.drones: dict[int, FlownDrone] = {}
        self.started: list[PatternEvent] = []
        self.formation_states: dict[Key, FormationState] = {}
        self._log = HandLog()
        states: dict[int, dict[Key, DroneState]] = {drone: {} for drone in formation.ids}
        for message in messages:
            self._take(message, states)
        self.started.sort(key=lambda event: event.started_ns)
        for drone in self.order():
            self.drones[drone] = self._index(drone, [states[drone][key] for key in sorted(states[drone])])

    def order(self) -> Iterator[int]:
        """Yields the numbers of the drones, references first."""
        return (self.formation.ids[row] for level in self.formation.levels for row in level)

    def sample(self, number: int) -> HandSample:
        """Returns a hand sample.

        Raises:
            ConfigError: It was not recorded.
        """
        if number in self.hands:
            return self.hands[number]
        known = f"it holds {min(self.hands)} to {max(self.hands)}" if self.hands else "it holds no hand"
        raise ConfigError(f"hand sample {number} is not in this trace; {known}")

    def number(self, heard: Heard) -> int | None:
        """Returns the number of a hand sample that somebody heard, None if its relay was never recorded."""
        return self._log.number(heard)

    def _take(self, message: Message, states: dict[int, dict[Key, DroneState]]) -> None:
        match message:
            case HandSample():
                self._log.add(message)
                number = self._log.number(Heard(message.epoch, message.seq, 0))
                if number is not None:
                    self.hands.setdefault(number, message)
            case DroneState() if message.id in states:
                states[message.id][message.epoch, message.seq] = message
            case PatternEvent(outcome="started"):
                self.started.append(message)
            case FormationState():
                self.formation_states[message.epoch, message.seq] = message
            case _:
                pass

    def _index(self, drone: int, states: list[DroneState]) -> FlownDrone:
        hands = self._log if self.formation.refers_to_human(drone) else None
        references = {DRONE_STATE.key(id=other): other for other in self.formation.references(drone)}
        through = [newest_through(state, hands, references, self._through) for state in states]
        heard = [self._log.number(s.heard[HAND_KEY]) if HAND_KEY in s.heard else None for s in states]
        direct = [max(_or_never(a), _or_never(b)) for a, b in zip(through, heard, strict=True)]
        return FlownDrone(states, [_or_never(number) for number in through], direct)

    def _through(self, drone: int, heard: Heard) -> int | None:
        flown = self.drones[drone]
        row = flown.row(heard)
        return None if row is None or flown.through[row] == NEVER else flown.through[row]


def _or_never(number: int | None) -> int:
    return NEVER if number is None else number


def _first(so_far: list[int], number: int) -> int | None:
    row = bisect_left(so_far, number)
    return row if row < len(so_far) else None
