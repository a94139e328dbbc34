"""What a process has heard: the newest valid sample per topic, and what was rejected, by reason."""

import logging
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, Generic, TypeVar, final

from msgspec.structs import replace

from shared.clock import NS_PER_S
from shared.codec import decode
from shared.errors import DecodeError
from shared.messages import NO_HAND, ORIGIN, DroneState, HandSample, Heard, Message, ObstacleState, Places, Wish
from shared.obstacle_watch import ObstacleWatch
from shared.order import check_newer
from shared.plausibility import HAND_LIMITS, Believed, MotionLimits, believe, check_ahead, check_possible
from shared.signature import Verify
from shared.topics import DRONE_STATE, HAND, OBSTACLE, PLACES, parse_key
from shared.transport import Arrival

M = TypeVar("M", bound=Message)

NEVER: Final = float("inf")
_HAND_KEY: Final = HAND.key()
_HAND_STALE: Final = HAND.stale_s
_DRONE_STALE: Final = DRONE_STATE.stale_s
_LOG_PERIOD_NS: Final = 5 * NS_PER_S
_log = logging.getLogger("senses")


@final
class Sensed(Generic[M]):
    """One message.

    Attributes:
        message: What was said.
        arrival_ns: When it arrived (own clock).
        heard: What to report about having used it, and what its order is judged by.
    """

    def __init__(self, message: M, arrival_ns: int) -> None:
        self.message: Final = message
        self.arrival_ns: Final = arrival_ns
        # As `Heard(...)`, which is a function of Python's.
        self.heard: Final = tuple.__new__(Heard, (message.epoch, message.seq, arrival_ns))

    def age(self, now_ns: int) -> float:
        """Returns the time since it arrived, s."""
        return (now_ns - self.arrival_ns) / NS_PER_S


@final
class Senses:
    """Newest valid hand sample and drone states of one listener.

    What cannot be (`shared.plausibility`) is not taken in. Of a hand only the motion is not: the wish counts,
    or a STOP would be lost with it, and one that wishes to FLY holds. A drone that is not believed stays where
    it was believed last, and grows old there.

    Args:
        ids: Numbers of the drones to listen to.
        verify: Checks the signature of hand samples; None accepts unsigned ones.
        bodies: What the bodies of drones can do; None believes everything, as one who only shows it does.
        obstacles: Whether to listen to moving obstacles as well.
        aside: Numbers of the drones that are heard at times, over links of their own.
        tellers: Numbers of the drones that tell where others are.

    Attributes:
        hand: Newest hand sample, None before the first.
        drones: Newest state per drone that was ever heard.
        obstacles: What is known of moving obstacles.
        places: What each of those who tell told last.
        doubted_ns: When something that was not believed last came, by key (own clock).
        rejected: Dropped samples by reason.
    """

    def __init__(
        self,
        ids: Iterable[int],
        verify: Verify | None = None,
        bodies: MotionLimits | None = None,
        *,
        obstacles: bool = False,
        aside: Iterable[int] = (),
        tellers: Iterable[int] = (),
    ) -> None:
        self.hand: Sensed[HandSample] | None = None
        self.drones: dict[int, Sensed[DroneState]] = {}
        self.obstacles = ObstacleWatch()
        self.places: dict[int, Sensed[Places]] = {}
        self._hears_obstacles = obstacles
        self.rejected: Counter[str] = Counter()
        self.doubted_ns: dict[str, int] = {}
        self._verify = verify
        self._bodies = bodies
        self._believed: dict[int, Believed] = {}
        self._believed_hand: Believed | None = None
        self._always = [DRONE_STATE.key(id=drone) for drone in ids]
        self._ids = {DRONE_STATE.key(id=drone): drone for drone in (*ids, *aside)}
        self._tellers = {PLACES.key(id=drone): drone for drone in tellers}
        self._logged_ns = 0

    @property
    def keys(self) -> list[str]:
        """Returns the keys to subscribe to."""
        obstacles = (OBSTACLE.wildcard,) if self._hears_obstacles else ()
        return [_HAND_KEY, *self._always, *self._tellers, *obstacles]

    def take(self, arrivals: Mapping[str, Sequence[Arrival]]) -> None:
        """Decodes what has arrived; nothing that anyone sends raises."""
        for key, samples in arrivals.items():
            for payload, arrival_ns in samples:
                try:
                    self._take_one(key, payload, arrival_ns)
                except DecodeError as error:
                    self._reject(key, error, arrival_ns)

    def hear_hand(self, sensed: Sensed[HandSample]) -> None:
        """Takes a sample in; of one whose motion cannot be, the wish.

        Raises:
            DecodeError: It is not newer than the last one.
        """
        if self.hand is not None:
            check_newer(sensed.heard, self.hand.heard, _HAND_STALE)
        sample = sensed.message
        if sample.position != NO_HAND:
            try:
                self._believed_hand = believe(
                    self._believed_hand, sample.position, sample.velocity, sensed.arrival_ns, HAND_LIMITS
                )
            except DecodeError as error:
                self.doubted_ns[_HAND_KEY] = sensed.arrival_ns
                self._reject(_HAND_KEY, DecodeError(f"hand-{error.reason}", error.detail), sensed.arrival_ns)
                sensed = Sensed(self._at_rest(sample), sensed.arrival_ns)
        self.hand = sensed

    def hear_drone(self, sensed: Sensed[DroneState]) -> None:
        """Takes a state in that need not be doubted.

        Raises:
            DecodeError: It is not newer than the last one of that drone.
        """
        self._check_drone(sensed)
        self.drones[sensed.message.id] = sensed

    def _take_one(self, key: str, payload: bytes, arrival_ns: int) -> None:
        if key == _HAND_KEY:
            sample = Sensed(decode(payload, HandSample), arrival_ns)
            if self._verify:
                # A signed sample that is older was recorded from the air: no silence makes it acceptable.
                if self.hand is not None:
                    check_newer(sample.heard, self.hand.heard, NEVER)
                self._verify(payload)
            self.hear_hand(sample)
            return
        drone = self._ids.get(key)
        if drone is None:
            self._take_other(key, payload, arrival_ns)
            return
        state = decode(payload, DroneState)
        if state.id != drone:
            raise DecodeError("wrong-id", f"drone {state.id} on {key}")
        sensed = Sensed(state, arrival_ns)
        self._check_drone(sensed)
        if self._bodies is not None:
            self._believe(key, sensed, self._bodies)
        self.drones[drone] = sensed

    def hear_places(self, sensed: Sensed[Places]) -> None:
        """Takes in what a drone tells of others.

        Raises:
            DecodeError: It is not newer than what that one told last.
        """
        if (known := self.places.get(sensed.message.id)) is not None:
            check_newer(sensed.heard, known.heard, PLACES.stale_s)
        self.places[sensed.message.id] = sensed

    def _take_other(self, key: str, payload: bytes, arrival_ns: int) -> None:
        teller = self._tellers.get(key)
        if teller is not None:
            self._take_places(key, payload, arrival_ns, teller)
            return
        place = parse_key(key)
        if place.topic is not OBSTACLE or not self._hears_obstacles:
            raise DecodeError("unknown-key", key)
        self.obstacles.hear(place.id, decode(payload, ObstacleState), arrival_ns)

    def _take_places(self, key: str, payload: bytes, arrival_ns: int, teller: int) -> None:
        told = decode(payload, Places)
        if told.id != teller:
            raise DecodeError("wrong-id", f"drone {told.id} on {key}")
        if self._bodies is not None:
            for seen in told.seen:
                check_possible(seen.position, seen.velocity, self._bodies)
        self.hear_places(Sensed(told, arrival_ns))

    def _check_drone(self, sensed: Sensed[DroneState]) -> None:
        if (known := self.drones.get(sensed.message.id)) is not None:
            check_newer(sensed.heard, known.heard, _DRONE_STALE)

    def _believe(self, key: str, sensed: Sensed[DroneState], bodies: MotionLimits) -> None:
        """Remembers a state that can be.

        Raises:
            DecodeError: It cannot; whoever says so is doubted from now on.
        """
        state, at_ns = sensed.message, sensed.arrival_ns
        try:
            believed = believe(self._believed.get(state.id), state.position, state.velocity, at_ns, bodies)
            check_possible(state.goal, state.goal_velocity, bodies)
            ahead, pace = state.ahead or state.position, state.pace or state.velocity
            check_ahead(state.position, state.velocity, ahead, pace, state.asked, bodies)
            self._believed[state.id] = believed
        except DecodeError:
            self.doubted_ns[key] = at_ns
            raise

    def _at_rest(self, sample: HandSample) -> HandSample:
        """Returns a hand where it was believed last, with the wish of a sample whose motion cannot be."""
        known, believed = self.hand, self._believed_hand
        return replace(
            sample,
            position=NO_HAND if believed is None else believed.position,
            velocity=ORIGIN,
            yaw=sample.yaw if known is None else known.message.yaw,
            mode=Wish.HOLD if sample.mode is Wish.FLY else sample.mode,
            jumped=True,
        )

    def _reject(self, key: str, error: DecodeError, now_ns: int) -> None:
        self.rejected[error.reason] += 1
        if now_ns - self._logged_ns > _LOG_PERIOD_NS:
            self._logged_ns = now_ns
            _log.warning("dropped a sample on %s: %s (so far %s)", key, error, dict(self.rejected))
