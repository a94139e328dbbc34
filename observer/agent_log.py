"""Statistics of one agent's flight from its states."""

import math

from attrs import frozen

from observer.hand_log import KEPT, HandLog
from observer.histogram import Histogram, Quantiles
from observer.through import HAND_KEY, newest_through
from shared.clock import NS_PER_S
from shared.formation import Formation
from shared.messages import DroneState, Heard, Mode
from shared.topics import DRONE_STATE

ON_TIME_NS = 4_000_000
"""A step is on time if it starts within this time of the last input it needed."""
_REMEMBERED_STATES = 512


@frozen(kw_only=True)
class AgentSummary:
    """One agent's flight.

    Attributes:
        id: Number of the drone.
        steps: Control steps taken, by sequence number.
        missed: Of these, the states that the observer did not receive.
        rate_hz: Steps per second.
        on_time: Fraction of steps that started within 4 ms of the last input they needed (a hand sample or a
            state of a reference that is new in the step); a step without any new input is not on time.
        hand_used: Of the hand samples sent from the first that the agent heard until its last step, the
            fraction that some step used.
        lateness_ms: From the last needed input to the start of the step.
        tracking_rms_m: RMS of |position - goal| in FOLLOW; None if it never followed.
        latency_ms: From the stamp of a hand sample to the stamp of the first set-point that contains it
            through every hop of the reference path; overtaken samples are not counted.
    """

    id: int
    steps: int
    missed: int
    rate_hz: float
    on_time: float
    hand_used: float
    lateness_ms: Quantiles
    tracking_rms_m: float | None
    latency_ms: Quantiles


class AgentLog:
    """What has been counted of one agent.

    Args:
        drone: Its number.
        formation: The formation, for what it refers to.
    """

    def __init__(self, drone: int, formation: Formation) -> None:
        self._drone = drone
        self._references = {DRONE_STATE.key(id=r): r for r in formation.references(drone)}
        self._follows_hand = formation.refers_to_human(drone)
        self._previous: DroneState | None = None
        self._through: dict[tuple[int, int], int] = {}
        self._received = self._missed = self._intervals = self._span_ns = 0
        self._on_time = 0
        self._lateness, self._latency = Histogram(), Histogram()
        self._square_error, self._followed = 0.0, 0
        self._use = _HandUse()
        self._newest_through = -1
        self.newest_latency_ms: float | None = None

    def add(self, state: DroneState, hands: HandLog, agents: "dict[int, AgentLog]") -> None:
        """Counts one state.

        Args:
            state: The next state; late and repeated ones are ignored, see `HandLog.add`.
            hands: Every hand sample up to now.
            agents: The logs of all agents; those of the references must be up to date.
        """
        if HAND_KEY not in state.heard or self._is_old(state):
            return
        previous = self._previous
        if previous is None or previous.epoch != state.epoch or previous.seq > state.seq:
            previous = None
            self._use.start_epoch()
        self._count_step(state, previous)
        self._count_punctuality(state, previous)
        self._use.add(hands.number(state.heard[HAND_KEY]), hands.sent_by(state.step_ns))
        self._follow_hand(state, hands, agents)
        if state.mode is Mode.FOLLOW:
            self._square_error += math.dist(state.position, state.goal) ** 2
            self._followed += 1
        self._previous = state

    def through(self, heard: Heard) -> int | None:
        """Returns the newest hand sample that came through every hop to one of the recent states."""
        return self._through.get((heard.epoch, heard.seq))

    def summary(self) -> AgentSummary:
        """Returns the numbers so far."""
        steps = self._received + self._missed
        return AgentSummary(
            id=self._drone,
            steps=steps,
            missed=self._missed,
            rate_hz=self._intervals * NS_PER_S / self._span_ns if self._span_ns else 0.0,
            on_time=self._on_time / self._received if self._received else 0.0,
            hand_used=self._use.fraction(),
            lateness_ms=self._lateness.quantiles(),
            tracking_rms_m=math.sqrt(self._square_error / self._followed) if self._followed else None,
            latency_ms=self._latency.quantiles(),
        )

    def _is_old(self, state: DroneState) -> bool:
        last = self._previous
        if last is None or (state.epoch, state.seq) > (last.epoch, last.seq):
            return False
        return state.epoch < last.epoch or last.seq - state.seq <= KEPT

    def _count_step(self, state: DroneState, previous: DroneState | None) -> None:
        self._received += 1
        if previous:
            advance = state.seq - previous.seq
            self._missed += advance - 1
            self._intervals += advance
            self._span_ns += state.stamp_ns - previous.stamp_ns

    def _count_punctuality(self, state: DroneState, previous: DroneState | None) -> None:
        before = previous.heard if previous else {}
        new = [
            heard.arrival_ns
            for key in (HAND_KEY, *self._references)
            if (heard := state.heard.get(key)) and heard[:2] != before.get(key, (0, 0, 0))[:2]
        ]
        if new:
            late_ns = max(0, state.step_ns - max(new))
            self._on_time += late_ns <= ON_TIME_NS
            self._lateness.add(late_ns / 1e6)

    def _follow_hand(self, state: DroneState, hands: HandLog, agents: "dict[int, AgentLog]") -> None:
        newest = newest_through(
            state,
            hands if self._follows_hand else None,
            self._references,
            lambda drone, heard: agents[drone].through(heard),
        )
        if newest is None:
            return
        self._remember(state, newest)
        if newest > self._newest_through:
            self._newest_through = newest
            sent_ns = hands.stamp_ns(newest)
            if sent_ns is not None:
                self.newest_latency_ms = (state.stamp_ns - sent_ns) / 1e6
                self._latency.add(self.newest_latency_ms)

    def _remember(self, state: DroneState, newest: int) -> None:
        self._through[state.epoch, state.seq] = newest
        if len(self._through) > _REMEMBERED_STATES:
            del self._through[next(iter(self._through))]


class _HandUse:
    """Which of the hand samples sent while an agent ran were used by it."""

    def __init__(self) -> None:
        self._used = self._sent = 0
        self._newest: int | None = None
        self._counted: int | None = None

    def start_epoch(self) -> None:
        """The agent restarted: what was sent while it was away does not count."""
        self._newest = self._counted = None

    def add(self, heard: int | None, sent: int | None) -> None:
        """Counts one step: the sample it used and the newest one sent by then."""
        if heard is None:
            return
        if self._newest is None or self._counted is None:
            self._newest = self._counted = heard - 1
        if heard > self._newest:
            self._used += 1
            self._newest = heard
        last = max(heard, sent if sent is not None else heard)
        self._sent += max(0, last - self._counted)
        self._counted = max(self._counted, last)

    def fraction(self) -> float:
        return self._used / self._sent if self._sent else 0.0
