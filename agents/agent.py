"""One drone's brain without I/O: bytes and time in, state out. The process loop and the simulator drive it."""

import functools
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from agents.around import drones_around, walkers_around
from agents.company import Company, Memory, look_around
from agents.control.hand import HandInput
from agents.control.modes import GROUND, HAND_STALE
from agents.control.repair import REFERENCE_LOST, Reference
from agents.control.step import Inputs, Settings, State, start, step
from agents.settings import clearances
from agents.stepping import Due, due_ns, step_rule
from agents.vehicles.base import Pose
from agents.vicinity import Vicinity
from shared.clock import NS_PER_S
from shared.fence import bodies_of
from shared.formation import Formation
from shared.messages import NO_HAND, DroneState, Flag, HandSample, Heard, Mode, Places, Seen
from shared.net.keyring import hand_verifier
from shared.nodes import neighbours, tellers
from shared.scenario import Scenario
from shared.senses import Sensed, Senses
from shared.topics import DRONE_STATE, HAND, PLACES
from shared.transport import Arrival
from shared.vehicles import vehicle_settings

NEVER: Final = float("inf")
HAND_KEY: Final = HAND.key()

DOUBTED_FOR: Final = 1.0
"""That somebody says what cannot be believed is told for this long, s."""
_PLACES_PERIOD_NS: Final = round(NS_PER_S / PLACES.rate_hz)
_DOUBTED_NS: Final = round(DOUBTED_FOR * NS_PER_S)
_NOBODY: Final[frozenset[int]] = frozenset()
_REJECTED_INPUT: Final[int] = Flag.REJECTED_INPUT.value
# Python takes as long to make a member of an enumeration as the law for half a step.
_flags_of = functools.cache(Flag)


class Agent:
    """Decodes what it hears, steps the control law, says what it did.

    Args:
        scenario: The scenario.
        formation: Its formation.
        drone: Own number.
        settings: Of this drone, see `agents.settings`.
        epoch: Start of this process, ns.

    Attributes:
        senses: What it has heard.
        tellers: Whom it hears tell of others.
        steps: How many it has made.
    """

    def __init__(
        self, scenario: Scenario, formation: Formation, drone: int, settings: Settings, epoch: int
    ) -> None:
        always = neighbours(scenario, formation, drone)
        everybody = [other for other in formation.ids if other != drone]
        self.tellers = frozenset(tellers(scenario, formation, drone))
        self.senses = Senses(
            always,
            hand_verifier(scenario.net),
            bodies_of(scenario, formation),
            aside=everybody,
            tellers=self.tellers,
            obstacles=True,
        )
        self.steps = 0
        self._drone = drone
        self._epoch = epoch
        self._references = {other: DRONE_STATE.key(id=other) for other in formation.references(drone)}
        self._kin = {kin.drone: DRONE_STATE.key(id=kin.drone) for kin in settings.kin}
        self._memories = memories(scenario, everybody)
        self._listened = {other: self._memories[other] for other in always}
        self._vicinity = Vicinity(always, self._memories) if len(always) < len(everybody) else None
        self._places: Places | None = None
        self._places_due_ns = self._told = 0
        self._clearances = clearances(scenario, formation, drone)
        self._links = [link.name for link in settings.row.links]
        self._settings = settings
        self._rule = step_rule(scenario.rates)
        self._nominal_dt = 1.0 / scenario.rates.control_hz
        self._state: State | None = None
        self._used: dict[str, Sensed[HandSample] | Sensed[DroneState]] = {}
        self._last_step_ns = 0

    @property
    def near(self) -> frozenset[int]:
        """Whom to hear directly for a while, beside those whom this drone always hears."""
        return _NOBODY if self._vicinity is None else self._vicinity.near

    def hears(self, drone: int) -> bool:
        """Says whether this drone hears another one, now or always."""
        return drone in self._listened or drone in self.near

    def receive(self, arrivals: Mapping[str, Sequence[Arrival]]) -> None:
        """Takes in what the bus delivered."""
        self.senses.take(arrivals)

    def due(self, now_ns: int) -> Due:
        """Returns when the next step is due, given what has been heard so far."""
        if self._rests(now_ns):
            return Due(self._last_step_ns + self._rule.resting, [HAND_KEY])
        awaited = self._awaited(now_ns)
        return Due(due_ns(self._rule, self._last_step_ns, inputs_complete=not awaited), awaited)

    def step(self, now_ns: int, pose: Pose, pose_age: float) -> DroneState:
        """Computes one step.

        Args:
            now_ns: Start of the step (own clock).
            pose: The vehicle's newest report.
            pose_age: Its age, s.

        Returns:
            The state to publish; its set-point and mode are for the vehicle. The caller sets `stamp_ns`.
        """
        if self._state is None:
            self._state = start(pose.position, self._settings, airborne=pose.airborne)
        dt = (now_ns - self._last_step_ns) / NS_PER_S if self.steps else self._nominal_dt
        self._look_afar(now_ns, pose, self._state.mode.mode)
        company = self._look_around(now_ns)
        inputs = self._inputs(now_ns, pose, pose_age, company)
        self._state, output = step(self._state, inputs, self._settings, dt)
        self._last_step_ns = now_ns
        links = self._state.links
        state = DroneState(
            epoch=self._epoch,
            seq=self.steps,
            stamp_ns=now_ns,
            id=self._drone,
            position=pose.position,
            velocity=pose.velocity,
            goal=output.goal,
            goal_velocity=output.goal_velocity,
            setpoint=output.setpoint,
            mode=self._state.mode.mode,
            displacements={name: links[i].displacement for i, name in enumerate(self._links)},
            pose_age=pose_age,
            battery=pose.battery,
            flags=_flags_of(output.flags | _REJECTED_INPUT if self._doubts(now_ns) else output.flags),
            heard=self._note_used(self._state),
            unheard=company.unheard,
            lost=company.lost,
            ahead=output.ahead,
            pace=output.pace,
            asked=output.asked,
            step_ns=now_ns,
        )
        self.steps += 1
        return state

    def _rests(self, now_ns: int) -> bool:
        hand = self.senses.hand
        grounded = self._state is not None and self._state.mode.mode is GROUND
        return grounded and (hand is None or hand.age(now_ns) > HAND_STALE)

    def _awaited(self, now_ns: int) -> list[str]:
        """Returns the inputs that are alive but not newer than at the last step; none: a step may be made.

        Whom it only avoids is never waited for. The hand is, but last: everybody hears it at once, and a drone
        has nothing to do before its references have stepped. References that have caught up with the hand of
        the last step do not wait for the next hand: a step that was too early for them would otherwise leave
        every later one a whole period behind.
        """
        live = [
            (key, sensed)
            for other, key in self._references.items()
            if (sensed := self.senses.drones.get(other)) and sensed.age(now_ns) <= REFERENCE_LOST
        ]
        if old := [key for key, sensed in live if not self._is_fresh(key, sensed)]:
            return old
        hand = self.senses.hand
        if hand is None or hand.age(now_ns) > HAND_STALE:
            return [] if live else [HAND_KEY]
        caught_up = bool(live) and all(_has_used(sensed.message, hand.message) for _, sensed in live)
        return [] if caught_up or self._is_fresh(HAND_KEY, hand) else [HAND_KEY]

    def _is_fresh(self, key: str, sensed: Sensed[HandSample] | Sensed[DroneState]) -> bool:
        return self._used.get(key) is not sensed

    def places(self) -> Places | None:
        """Returns what is to be told of everybody after a step, once.

        In a swarm in which everybody hears everybody nobody is told of others.
        """
        places, self._places = self._places, None
        return places

    def _look_afar(self, now_ns: int, pose: Pose, mode: Mode) -> None:
        """Takes in what was told of others, decides anew whom to listen to, and what to tell."""
        vicinity, senses = self._vicinity, self.senses
        if vicinity is None or now_ns < self._places_due_ns:
            return
        self._places_due_ns = now_ns + _PLACES_PERIOD_NS
        own = Seen(self._drone, self._epoch, self.steps, pose.position, pose.velocity, mode, 0.0)
        seen = vicinity.look(own, senses.drones, senses.places, now_ns)
        self._places = Places(epoch=self._epoch, seq=self._told, stamp_ns=now_ns, id=self._drone, seen=seen)
        self._told += 1

    def _look_around(self, now_ns: int) -> Company:
        senses, vicinity, listened = self.senses, self._vicinity, self._listened
        if vicinity is not None and vicinity.near:
            counted = vicinity.counted(senses.drones, now_ns)
            listened = listened | {other: self._memories[other] for other in counted}
        doubted: dict[int, int] = {}
        if senses.doubted_ns:
            keys = {drone: DRONE_STATE.key(id=drone) for drone in listened}
            doubted = {drone: senses.doubted_ns[key] for drone, key in keys.items() if key in senses.doubted_ns}
        if vicinity is None:
            return look_around(self._drone, listened, senses.drones, doubted, now_ns)
        elsewhere = vicinity.known(now_ns)
        company = look_around(self._drone, listened, senses.drones, doubted, now_ns, elsewhere)
        # Whoever has just come near is kept away from as it was told, until it is heard.
        coming = [elsewhere(drone) for drone in vicinity.near if drone not in listened]
        company.missing.extend(seen for seen in coming if seen is not None)
        return company

    def _inputs(self, now_ns: int, pose: Pose, pose_age: float, company: Company) -> Inputs:
        hand, heard = self.senses.hand, self.senses.drones
        safety = self._settings.steering.safety
        return Inputs(
            position=pose.position,
            velocity=pose.velocity,
            pose_age=pose_age,
            battery=pose.battery,
            hand=None if hand is None or hand.message.position == NO_HAND else hand_input(hand.message),
            wish=None if hand is None else hand.message.mode,
            hand_age=NEVER if hand is None else hand.age(now_ns),
            hand_fresh=hand is not None and self._is_fresh(HAND_KEY, hand),
            references=[self._reference(heard.get(kin), key, now_ns) for kin, key in self._kin.items()],
            drones=drones_around(company, self._clearances, safety.horizontal.lag, now_ns),
            obstacles=walkers_around(self.senses.obstacles.present(now_ns), safety),
            missed=company.missed,
            awaiting=bool(company.awaited),
            alone=company.alone,
        )

    def _reference(self, sensed: Sensed[DroneState] | None, key: str, now_ns: int) -> Reference | None:
        if sensed is None:
            return None
        state, stable = sensed.message, self._settings.stable
        return Reference(
            point=state.goal if stable else state.position,
            velocity=state.goal_velocity if stable else state.velocity,
            goal_velocity=state.goal_velocity,
            mode=state.mode,
            age=sensed.age(now_ns),
            fresh=self._is_fresh(key, sensed),
        )

    def _doubts(self, now_ns: int) -> bool:
        """Says whether what the hand or a neighbour said was not believed, a moment ago."""
        return any(now_ns - doubted_ns <= _DOUBTED_NS for doubted_ns in self.senses.doubted_ns.values())

    def _note_used(self, state: State) -> dict[str, Heard]:
        """Notes, and returns, what this step used: hand, references, and who stands behind one that is gone."""
        hand, drones = self.senses.hand, self.senses.drones
        used: dict[str, Sensed[HandSample] | Sensed[DroneState]] = {} if hand is None else {HAND_KEY: hand}
        for other, key in (self._kin if state.stand_ins else self._references).items():
            if other in drones:
                used[key] = drones[other]
        self._used = used
        return {key: sensed.heard for key, sensed in used.items()}


def _has_used(state: DroneState, hand: HandSample) -> bool:
    heard = state.heard.get(HAND_KEY)
    return heard is not None and (heard.epoch, heard.seq) == (hand.epoch, hand.seq)


def hand_input(sample: HandSample) -> HandInput:
    """Returns a sample as the control law takes it."""
    return HandInput(
        position=sample.position,
        velocity=sample.velocity,
        yaw=sample.yaw,
        # Counted from the relay's start: seconds since 1970 would leave a float with a quarter microsecond.
        stamp=(sample.stamp_ns - sample.epoch) / NS_PER_S,
    )


def memories(scenario: Scenario, others: Iterable[int]) -> dict[int, Memory]:
    """Returns for how long each of some drones is remembered when it falls silent."""
    limits = scenario.limits
    return {
        other: Memory(
            vehicle_settings(scenario, other).link_loss == "hover", limits.takeoff_height, limits.landing_speed
        )
        for other in others
    }
