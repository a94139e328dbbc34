"""The swarm of a case: real agents in lockstep on a virtual clock, under the weather and faults of the case."""

from functools import lru_cache

import numpy as np
from attrs import field, frozen

from agents.agent import Agent, hand_input
from agents.control.hand import map_hand
from agents.control.modes import CRITICAL_BATTERY, POSE_LOST, is_guided
from agents.settings import agent_settings, hand_settings
from agents.vehicles.base import Pose
from agents.vehicles.bodies.fleet import advance, hold, pose_of
from agents.vehicles.bodies.link_loss import obeyed
from agents.vehicles.bodies.state import CUT, DESCEND, FLY, IDLE
from deploy.falsify.air import Air
from deploy.falsify.case import Case, FaultKind
from deploy.falsify.hand import poses, samples, tracked
from deploy.lockstep.start import EPOCH, introduce, rest_places, start_flyers
from deploy.lockstep.ticks import tick_length, tick_ns
from shared.arrays import Mask, Vec
from shared.clock import NS_PER_S
from shared.envelope import AxisEnvelope, envelope_of
from shared.formation import Formation
from shared.messages import DroneState, HandSample, Mode, Vector
from shared.scenario import Scenario
from shared.scenario_check.check import open_scenario
from shared.vehicles import vehicle_settings


@frozen(kw_only=True, eq=False)
class Flown:
    """What happened in T ticks to N drones.

    Attributes:
        t: (T,) s.
        hand: (T, 3) the true hand, m.
        position: (T, N, 3) the true bodies, m.
        able: (T, N) whose process runs, sees its body and is not held: it can keep its distance.
        hearing: (T, N) who of these has heard lately where the hand is.
        guided: (T, N) who of these follows or holds.
        vehicles: What the N vehicles can do horizontally.
    """

    t: Vec = field()
    hand: Vec = field()
    position: Vec = field()
    able: Mask = field()
    hearing: Mask = field()
    guided: Mask = field()
    vehicles: tuple[AxisEnvelope, ...] = field()


@lru_cache(maxsize=64)
def prepare(scenario: str, overrides: tuple[str, ...]) -> tuple[Scenario, Formation]:
    """Opens the scenario of a case; agents in lockstep say what they say without a network.

    Raises:
        ConfigError: It is refused.
    """
    return open_scenario(scenario, overrides, network=False)


def fly(case: Case) -> Flown:
    """Flies a case to its end.

    Raises:
        ConfigError: Its scenario is refused.
    """
    scenario, formation = prepare(case.scenario, case.overrides)
    rate = scenario.rates.control_hz
    hand = poses(case, rate)
    said = samples(case, tracked(case, hand, formation))
    swarm = Swarm(case, scenario, formation, _start(case, scenario, formation, said[0]))
    rows = [swarm.advance(sample) for sample in said]
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    true = np.array([pose.position for pose in hand])
    return Flown(
        t=np.array([pose.t_ns / NS_PER_S for pose in hand]),
        hand=true,
        position=columns[0],
        able=columns[1],
        hearing=columns[2] & _is_true(true, said, round(_HAND_LATELY * rate))[:, None],
        guided=columns[3],
        vehicles=tuple(envelope_of(scenario, drone).horizontal for drone in formation.ids),
    )


def _is_true(hand: Vec, said: list[HandSample], lately: int) -> Mask:
    """Returns at which ticks the hand is, and has lately been, where it is said to be: no mistaken tracker."""
    wrong = np.linalg.norm(hand - np.array([sample.position for sample in said]), axis=1) > _HAND_OFF
    begun = np.concatenate([[0], np.cumsum(wrong)])
    ticks = np.arange(len(wrong))
    found: Mask = begun[ticks + 1] == begun[np.maximum(ticks - lately, 0)]
    return found


def _start(case: Case, scenario: Scenario, formation: Formation, first: HandSample) -> list[Vector]:
    """Returns where the bodies begin, m: about the mapped hand, or below the rest formation at home."""
    if case.airborne:
        return rest_places(formation, map_hand(None, hand_input(first), hand_settings(scenario, formation)))
    home_x, home_y = scenario.hand.home
    return [(home_x + x, home_y + y, 0.0) for x, y, _ in formation.rest]


Row = tuple[list[Vector], list[bool], list[bool], list[bool]]


class Swarm:
    """Agents and bodies of one case, driven tick by tick.

    Args:
        case: What happens to them.
        scenario: Its scenario.
        formation: Its formation.
        places: Where they begin, m.
    """

    def __init__(self, case: Case, scenario: Scenario, formation: Formation, places: list[Vector]) -> None:
        self._case, self._scenario, self._formation = case, scenario, formation
        self._rate = scenario.rates.control_hz
        self._order = [row for level in formation.levels for row in level]
        self._flyers = start_flyers(scenario, formation, places, airborne=case.airborne)
        self._air = Air(case, formation.ids, self._rate)
        agents = [self._agent(drone, EPOCH) for drone in formation.ids]
        introduce(agents, formation, self._flyers)
        self._agents: list[Agent | None] = [*agents]
        self._told: list[tuple[int, Vector, int]] = [(CUT, (0.0, 0.0, 0.0), 0)] * len(formation.ids)
        self._poses: dict[int, tuple[Pose, int]] = {}
        self._modes = [Mode.GROUND] * len(formation.ids)
        self._hovers = [vehicle_settings(scenario, d).link_loss == "hover" for d in formation.ids]
        self._tick = 0

    def advance(self, sample: HandSample) -> Row:
        """Makes one tick: weather, hand, agents level by level, bodies.

        Args:
            sample: What the relay sends in this tick.

        Returns:
            A row of `Flown` for the bodies as they were at the beginning of the tick.
        """
        now = tick_ns(self._tick, self._rate)
        on = self._faults(now / NS_PER_S)
        self._live_and_die(on, now)
        self._air.begin(self._tick, self._agents)
        self._air.publish(sample, self._tick, self._agents)
        row = self._look(on, now)
        for each in self._order:
            if (agent := self._agents[each]) is not None:
                state = self._step(agent, each, on, now)
                self._air.publish(state, self._tick, self._agents)
                if (told := agent.places()) is not None:
                    self._air.publish(told, self._tick, self._agents)
                self._told[each] = (_command_of(state), state.setpoint, now)
                self._modes[each] = state.mode
        self._move(now)
        self._tick += 1
        return row

    def _agent(self, drone: int, now_ns: int) -> Agent:
        scenario, formation = self._scenario, self._formation
        return Agent(scenario, formation, drone, agent_settings(scenario, formation, drone), epoch=now_ns)

    def _faults(self, t: float) -> dict[FaultKind, set[int]]:
        found: dict[FaultKind, set[int]] = {}
        for fault in self._case.faults:
            if fault.on(t) and fault.drone:
                found.setdefault(fault.kind, set()).add(self._formation.row(fault.drone))
        return found

    def _live_and_die(self, on: dict[FaultKind, set[int]], now_ns: int) -> None:
        dead = on.get("kill", set())
        for row, drone in enumerate(self._formation.ids):
            if row in dead:
                self._agents[row] = None
            elif self._agents[row] is None:
                self._agents[row] = self._agent(drone, now_ns)
        held = on.get("held", set())
        self._flyers = [
            flyer if flyer.held == (row in held) else hold(flyer, held=row in held)
            for row, flyer in enumerate(self._flyers)
        ]

    def _look(self, on: dict[FaultKind, set[int]], now_ns: int) -> Row:
        rows = range(len(self._agents))
        unable = on.get("held", set()) | on.get("blind", set())
        able = [self._agents[row] is not None and row not in unable for row in rows]
        return (
            [flyer.body.position for flyer in self._flyers],
            able,
            [able[row] and _hears_hand(self._agents[row], now_ns) for row in rows],
            [able[row] and is_guided(self._modes[row]) for row in rows],
        )

    def _step(self, agent: Agent, row: int, on: dict[FaultKind, set[int]], now_ns: int) -> DroneState:
        charge = 0.5 * CRITICAL_BATTERY if row in on.get("empty", ()) else 1.0
        if row not in on.get("blind", ()) or row not in self._poses:
            self._poses[row] = (pose_of(self._flyers[row], charge, self._tick), now_ns)
        pose, seen_ns = self._poses[row]
        return agent.step(now_ns, pose, (now_ns - seen_ns) / NS_PER_S)

    def _move(self, now_ns: int) -> None:
        duration = tick_length(self._tick, self._rate)
        for row, (kind, setpoint, told_ns) in enumerate(self._told):
            kind_now = obeyed(kind, (now_ns - told_ns) / NS_PER_S, hovers=self._hovers[row])
            self._flyers[row] = advance(self._flyers[row], kind_now, setpoint, duration)


_HAND_LATELY = 0.25
"""Who has heard the hand within this time knows where it is, s."""


_HAND_OFF = 0.05
"""A hand that is said to be farther away than this from where it is is another one, m."""


def _hears_hand(agent: Agent | None, now_ns: int) -> bool:
    hand = agent.senses.hand if agent is not None else None
    return hand is not None and hand.age(now_ns) <= _HAND_LATELY


def _command_of(state: DroneState) -> int:
    """Returns what a vehicle is told by a step, see `agents.loop.command`."""
    if state.mode is Mode.STOP:
        return CUT
    if state.mode is Mode.GROUND:
        return IDLE
    return DESCEND if state.pose_age > POSE_LOST else FLY
