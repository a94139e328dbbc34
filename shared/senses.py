"""What a process has heard: the newest valid sample per topic, and what was rejected, by reason."""

import logging
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Generic, TypeVar

from msgspec import Struct

from shared.clock import NS_PER_S
from shared.codec import decode
from shared.errors import DecodeError
from shared.messages import DroneState, HandSample, Heard, Message
from shared.signature import Verify
from shared.topics import DRONE_STATE, HAND
from shared.transport import Arrival

M = TypeVar("M", bound=Message)

NEVER = float("inf")
_HAND_KEY = HAND.key()
_LOG_PERIOD_NS = 5 * NS_PER_S
_log = logging.getLogger("senses")


class Sensed(Struct, Generic[M], frozen=True):
    """One message and when it arrived (own clock, ns)."""

    message: M
    arrival_ns: int

    @property
    def heard(self) -> Heard:
        """Returns what to report about having used it."""
        return Heard(self.message.epoch, self.message.seq, self.arrival_ns)

    def age(self, now_ns: int) -> float:
        """Returns the time since it arrived, s."""
        return (now_ns - self.arrival_ns) / NS_PER_S


class Senses:
    """Newest valid hand sample and drone states of one listener.

    Args:
        ids: Numbers of the drones to listen to.
        verify: Checks the signature of hand samples; None accepts unsigned ones.

    Attributes:
        hand: Newest hand sample, None before the first.
        drones: Newest state per drone that was ever heard.
        rejected: Dropped samples by reason.
    """

    def __init__(self, ids: Iterable[int], verify: Verify | None = None) -> None:
        self.hand: Sensed[HandSample] | None = None
        self.drones: dict[int, Sensed[DroneState]] = {}
        self.rejected: Counter[str] = Counter()
        self._verify = verify
        self._ids = {DRONE_STATE.key(id=drone): drone for drone in ids}
        self._logged_ns = 0

    @property
    def keys(self) -> list[str]:
        """Returns the keys to subscribe to."""
        return [_HAND_KEY, *self._ids]

    def take(self, arrivals: Mapping[str, Sequence[Arrival]]) -> None:
        """Decodes what has arrived; nothing that anyone sends raises."""
        for key, samples in arrivals.items():
            for payload, arrival_ns in samples:
                try:
                    self._take_one(key, payload, arrival_ns)
                except DecodeError as error:
                    self._reject(key, error, arrival_ns)

    def hear_hand(self, sensed: Sensed[HandSample]) -> None:
        """Takes a sample in.

        Raises:
            DecodeError: It is not newer than the last one.
        """
        _check_newer(sensed, self.hand, HAND.stale_s)
        self.hand = sensed

    def hear_drone(self, sensed: Sensed[DroneState]) -> None:
        """Takes a state in.

        Raises:
            DecodeError: It is not newer than the last one of that drone.
        """
        drone = sensed.message.id
        _check_newer(sensed, self.drones.get(drone), DRONE_STATE.stale_s)
        self.drones[drone] = sensed

    def _take_one(self, key: str, payload: bytes, arrival_ns: int) -> None:
        if key == _HAND_KEY:
            sample = Sensed(decode(payload, HandSample), arrival_ns)
            if self._verify:
                # A signed sample that is older was recorded from the air: no silence makes it acceptable.
                _check_newer(sample, self.hand, NEVER)
                self._verify(payload)
            self.hear_hand(sample)
            return
        drone = self._ids.get(key)
        if drone is None:
            raise DecodeError("unknown-key", key)
        state = decode(payload, DroneState)
        if state.id != drone:
            raise DecodeError("wrong-id", f"drone {state.id} on {key}")
        self.hear_drone(Sensed(state, arrival_ns))

    def _reject(self, key: str, error: DecodeError, now_ns: int) -> None:
        self.rejected[error.reason] += 1
        if now_ns - self._logged_ns > _LOG_PERIOD_NS:
            self._logged_ns = now_ns
            _log.warning("dropped a sample on %s: %s (so far %s)", key, error, dict(self.rejected))


def _check_newer(sensed: Sensed[M], known: Sensed[M] | None, stale_s: float) -> None:
    """Refuses what is not newer by (epoch, seq).

    Raises:
        DecodeError: `out-of-order`. An older epoch is accepted once the newer one has fallen silent, or a
            publisher whose clock was set back would never be heard again.
    """
    if known is None:
        return
    message, last = sensed.message, known.message
    if message.epoch == last.epoch and message.seq > last.seq:
        return
    if message.epoch > last.epoch or (message.epoch < last.epoch and known.age(sensed.arrival_ns) > stale_s):
        return
    raise DecodeError("out-of-order", f"({message.epoch}, {message.seq}) after ({last.epoch}, {last.seq})")
