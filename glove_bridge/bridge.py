"""The bridge between what is heard of the swarm and what the operator feels. Pure: time is passed in.

Receive, then step: which drones are heard, the state of their formation by the rule of the pattern set, the
pattern that it calls for, the safety cues, and what the scheduler makes of them.
"""

from collections import Counter
from collections.abc import Mapping, Sequence

from attrs import frozen

from glove_bridge.cues import Cue, active_cues
from glove_bridge.formation_state import Geometry, Memory, Reading, default_geometry
from glove_bridge.gloves.base import Outcome, Report
from glove_bridge.meaning import MEANINGS
from glove_bridge.patterns.pattern import Pattern, PatternSet
from glove_bridge.rules import RULES
from glove_bridge.scheduler import Request, Schedule, decide, ended, started
from glove_bridge.swarm_view import FORMED, DroneStates, all_heard, missing_drones, newest_heard, scene_of
from shared.errors import ConfigError
from shared.fence import bodies_of
from shared.formation import Formation
from shared.messages import FormationState, Heard, PatternEvent, Wish
from shared.net.keyring import hand_verifier
from shared.scenario import Scenario
from shared.senses import Senses
from shared.topics import DRONE_STATE, HAND
from shared.transport import Arrival

GLOVE_THERE = "glove_there"
"""Metric of the bridge's status: 1 while patterns can be felt, else 0."""


@frozen(kw_only=True)
class Step:
    """What one step decided.

    Attributes:
        state: The formation, as it is to be published.
        stop: Whether the operator wishes STOP: the glove has to be silent.
        play: To be played now, None if nothing is.
        events: To be published.
    """

    state: FormationState
    stop: bool = False
    play: Pattern | None = None
    events: tuple[PatternEvent, ...] = ()


class Bridge:
    """The bridge of one swarm.

    Args:
        scenario: The scenario.
        formation: Its formation.
        patterns: Pattern set for the state of the formation.
        cues: Pattern set of the safety cues.
        epoch: Start of the process, ns.

    Attributes:
        senses: What was heard, and what was rejected.
        missing: Drones of the formation that are not heard.
        counts: Pattern events by outcome.
        steps: Number of steps so far.

    Raises:
        ConfigError: A set has the other one's meaning.
    """

    def __init__(
        self, scenario: Scenario, formation: Formation, patterns: PatternSet, cues: PatternSet, epoch: int
    ) -> None:
        if patterns.meaning not in MEANINGS or cues.meaning in MEANINGS:
            raise ConfigError(
                f"pattern set {patterns.name!r} means {patterns.meaning!r}; choose one that means"
                f" {' or '.join(map(repr, MEANINGS))}"
            )
        self.senses = Senses(formation.ids, hand_verifier(scenario.net), bodies_of(scenario, formation))
        self.missing = formation.ids
        self.counts: Counter[Outcome] = Counter()
        self.steps = 0
        self._formation, self._patterns, self._cues = formation, patterns, cues
        self._follow_yaw = scenario.hand.follow_yaw
        self._left_ns: dict[int, int] = {}
        self._geometry: Geometry | None = None
        self._memory = Memory()
        self._schedule = Schedule()
        self._started_ns = 0
        self._epoch, self._state_seq, self._event_seq = epoch, 0, 0

    def receive(self, arrivals: Mapping[str, Sequence[Arrival]]) -> None:
        """Takes in what has arrived; nothing that anyone sends raises."""
        self.senses.take(arrivals)

    def presence_changed(self, token: str, present: bool, now_ns: int) -> None:
        """Takes in that a process came or left, for example `drone/2`: quicker than waiting for silence."""
        role, _, number = token.partition("/")
        if role == "drone" and not present:
            self._left_ns[int(number)] = now_ns

    def step(self, now_ns: int, *, connected: bool = True) -> Step:
        """Decides what to publish and to play now, on a glove that is there or not."""
        self.steps += 1
        self.missing = missing_drones(self._formation.ids, self.senses.drones, self._left_ns, now_ns)
        drones = {drone: s for drone, s in self.senses.drones.items() if drone not in self.missing}
        reading = self._read(drones, now_ns)
        state = self._state(reading, drones, now_ns)
        hand = self.senses.hand
        if hand is not None and hand.message.mode is Wish.STOP:
            return Step(state=state, stop=True)
        formed = all(sensed.message.mode in FORMED for sensed in drones.values())
        wish = self._wish(reading) if formed else None
        silent = self._patterns.silent_gate and formed and reading is not None and reading.extent != 0
        self._schedule, decision = decide(
            self._schedule, wish, self._cue_requests(now_ns), now_ns, silent=silent, connected=connected
        )
        return Step(
            state=state,
            play=decision.play.pattern if decision.play else None,
            events=tuple(self._event(request, Outcome.SUPPRESSED, now_ns) for request in decision.suppressed),
        )

    def state_published(self) -> None:
        """Notes that the state of the last step went out: the next one gets the next number."""
        self._state_seq += 1

    def reported(self, report: Report, now_ns: int) -> PatternEvent | None:
        """Takes in what the glove reports of the pattern that it plays.

        Returns:
            The event to publish, None if nothing was to be played.
        """
        request = self._schedule.playing
        if request is None:
            return None
        if report.outcome is Outcome.STARTED:
            self._started_ns = report.at_ns
            self._schedule = started(self._schedule, report.at_ns)
            return self._event(request, report.outcome, now_ns, started_ns=report.at_ns)
        self._schedule = ended(self._schedule, felt=report.outcome is Outcome.FINISHED)
        started_ns, self._started_ns = self._started_ns, 0
        finished_ns = report.at_ns if report.outcome is Outcome.FINISHED else 0
        return self._event(request, report.outcome, now_ns, started_ns=started_ns, finished_ns=finished_ns)

    def _read(self, drones: DroneStates, now_ns: int) -> Reading | None:
        """Reads the formation of those that are heard, None if nobody is."""
        ids = tuple(sorted(drones))
        if not ids:
            self._memory = Memory()
            return None
        if self._geometry is None or self._geometry.ids != ids:
            self._geometry = default_geometry(self._formation, ids)
        hand = self.senses.hand
        yaw = hand.message.yaw if hand is not None and self._follow_yaw else 0.0
        scene = scene_of([drones[drone] for drone in ids], yaw, now_ns)
        rule = RULES[self._patterns.rule]
        reading, self._memory = rule(self._geometry, scene, self._memory, self._patterns.thresholds)
        return reading

    def _state(self, reading: Reading | None, drones: DroneStates, now_ns: int) -> FormationState:
        return FormationState(
            epoch=self._epoch,
            seq=self._state_seq,
            stamp_ns=now_ns,
            area=reading.area if reading else 0.0,
            area_ratio=reading.area_ratio if reading else 0.0,
            distances={f"{a}-{b}": d for (a, b), d in reading.distances.items()} if reading else {},
            extent=reading.extent if reading else 0,
            trend=reading.trend if reading else 0,
            displacement=reading.displacement if reading else 0.0,
            missing=self.missing,
            heard=all_heard(self.senses, drones),
        )

    def _wish(self, reading: Reading | None) -> Request | None:
        name = MEANINGS[self._patterns.meaning](reading) if reading else None
        return self._request(self._patterns.patterns[name], newest_heard(self.senses)) if name else None

    def _cue_requests(self, now_ns: int) -> list[tuple[Cue, Request]]:
        hand = self.senses.hand
        # A hand that has jumped is not followed, as one that is silent is not: it feels the same.
        hand_stale = hand is not None and (hand.age(now_ns) > HAND.stale_s or hand.message.jumped)
        states = {drone: sensed.message for drone, sensed in self.senses.drones.items()}
        cues = active_cues(states, self.missing, hand_stale=hand_stale)
        return [(cue, self._request(self._cues.patterns[cue.pattern], self._cue_heard(cue))) for cue in cues]

    def _cue_heard(self, cue: Cue) -> dict[str, Heard]:
        """A lost drone's cue is about its last sample, every other one about the newest."""
        lost = self.senses.drones.get(cue.drone)
        return {DRONE_STATE.key(id=cue.drone): lost.heard} if lost else newest_heard(self.senses)

    def _request(self, pattern: Pattern, heard: Mapping[str, Heard]) -> Request:
        return Request(pattern=pattern, state_seq=self._state_seq, heard=heard)

    def _event(
        self, request: Request, outcome: Outcome, now_ns: int, *, started_ns: int = 0, finished_ns: int = 0
    ) -> PatternEvent:
        self.counts[outcome] += 1
        self._event_seq += 1
        return PatternEvent(
            epoch=self._epoch,
            seq=self._event_seq - 1,
            stamp_ns=now_ns,
            pattern=request.pattern.name,
            outcome=outcome.value,
            state_seq=request.state_seq,
            heard=dict(request.heard),
            started_ns=started_ns,
            finished_ns=finished_ns,
        )
