"""All drones at once: the same pure control law on every row, without agents and messages in between.

It is the swarm as one central computer would fly it, all drones in FOLLOW, and it carries B independent runs
side by side. Where nobody keeps off anybody its numbers are those of the agents; where somebody does, a
drone here sees the others as they are in this tick, while an agent sees those that step after it one tick late.
"""

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from typing import NamedTuple

import numpy as np
from attrs import field, frozen

from agents.control.avoidance import DRONE_BUBBLE, Encounters
from agents.control.goals import all_rows, corrections, goals, place_velocities, rotate
from agents.control.impedance import LinkState, step_links, transition_rows
from agents.control.steering import Surroundings, steer
from agents.control.trajectory import norm, start_at
from agents.settings import hand_settings, steering_settings
from agents.vehicles.bodies.fleet import advance_fleet
from agents.vehicles.bodies.state import Command, Commands
from deploy.lockstep.hand_track import HandTrack, track_hand
from deploy.lockstep.record import Moment, Record, make_record
from deploy.lockstep.start import rest_places, start_fleet
from deploy.lockstep.ticks import tick_length
from shared.cells import Rows, near_pairs
from shared.formation import Formation, Link, Vec
from shared.messages import HandSample
from shared.scenario import Scenario


@frozen(kw_only=True)
class Hands:
    """The hands of B runs at one tick, shaped to meet arrays (B, N, 3).

    Attributes:
        position: (B, 1, 3) m.
        velocity: (B, 1, 3) m/s.
        point: (B, 1, 3) mapped, m.
        point_velocity: (B, 1, 3) m/s.
        yaw: (B, 1) rad.
        yaw_rate: (B, 1) rad/s.
    """

    position: Vec = field(eq=False)
    velocity: Vec = field(eq=False)
    point: Vec = field(eq=False)
    point_velocity: Vec = field(eq=False)
    yaw: Vec = field(eq=False)
    yaw_rate: Vec = field(eq=False)


def hands_at(tracks: Sequence[HandTrack], tick: int) -> Hands:
    """Returns the hands at one tick; a track that is over stays at its end."""
    rows = [min(tick, len(track.t) - 1) for track in tracks]
    pairs = list(zip(tracks, rows, strict=True))
    return Hands(
        position=np.array([track.position[k] for track, k in pairs])[:, None],
        velocity=np.array([track.velocity[k] for track, k in pairs])[:, None],
        point=np.array([track.point[k] for track, k in pairs])[:, None],
        point_velocity=np.array([track.point_velocity[k] for track, k in pairs])[:, None],
        yaw=np.array([track.yaw[k] for track, k in pairs])[:, None],
        yaw_rate=np.array([track.yaw_rate[k] for track, k in pairs])[:, None],
    )


class Level(NamedTuple):
    """Drones whose references are all in earlier levels.

    Attributes:
        rows: (k,) the drones.
        references: (k, r) columns of their references in `[human, drones...]`, padded with 0.
        weights: (k, r) their weights, padded with 0.
    """

    rows: Rows
    references: Rows
    weights: Vec


def _level(weights: Vec, rows: Sequence[int]) -> Level:
    columns = [np.flatnonzero(weights[row]) for row in rows]
    shape = (len(rows), max(map(len, columns)))
    references, shares = np.zeros(shape, dtype=np.intp), np.zeros(shape)
    for k, (row, own) in enumerate(zip(rows, columns, strict=True)):
        references[k, : len(own)], shares[k, : len(own)] = own, weights[row, own]
    return Level(np.array(rows), references, shares)


def _parameters(link: Link) -> tuple[float, ...]:
    return (link.mass, link.damping, link.stiffness, link.gain)


class Batch:
    """B runs of one formation of N drones, driven tick by tick.

    Args:
        scenario: The scenario.
        formation: Its formation.
        places: (B, N, 3) where the drones hover at the start, m.
        held: Drones that a hand holds in place, as (run, row) pairs.

    Attributes:
        fleet: The B x N bodies now, run after run.
        tick: Number of the next tick.
    """

    def __init__(
        self,
        scenario: Scenario,
        formation: Formation,
        places: Vec,
        held: AbstractSet[tuple[int, int]] = frozenset(),
    ) -> None:
        runs, drones, _ = places.shape
        flat = places.reshape(-1, 3)
        numbers = {1 + run * drones + row for run, row in held}
        self.fleet = start_fleet(scenario, formation, flat, airborne=True, held=numbers)
        self.tick = 0
        self._scenario = scenario
        self._formation = formation
        self._shape = places.shape
        self._rows = all_rows(formation)
        distinct = {_parameters(link): link for link in formation.links}
        self._link_kinds = tuple(distinct.values())
        kinds = {parameters: kind for kind, parameters in enumerate(distinct)}
        self._kind_of = np.array([kinds[_parameters(link)] for link in formation.links], dtype=np.intp)
        self._levels = [_level(formation.weights, rows) for rows in formation.levels]
        self._links = LinkState(
            displacement=np.zeros((runs, len(formation.links), 3)),
            rate=np.zeros((runs, len(formation.links), 3)),
        )
        self._trajectory = start_at(flat)
        self._steering = steering_settings(scenario, formation, formation.ids * runs)
        self._run_of = np.repeat(np.arange(runs), drones)

    def advance(self, hands: Hands) -> Moment:
        """Makes one tick.

        Args:
            hands: One per run.

        Returns:
            What was computed, arrays (B, N, 3) and (B, L, 3).
        """
        rate = self._scenario.rates.control_hz
        dt = tick_length(self.tick - 1, rate) if self.tick else 1.0 / rate
        goal, goal_velocity = self._law(hands, dt)
        steered = steer(
            self._trajectory,
            goal.reshape(-1, 3),
            goal_velocity.reshape(-1, 3),
            self._around(hands),
            self._steering,
            dt,
        )
        self._trajectory = steered.trajectory
        moment = Moment(
            position=self.fleet.position.reshape(self._shape),
            goal=goal,
            setpoint=steered.setpoint.reshape(self._shape),
            displacement=self._links.displacement,
        )
        flying = np.full(len(steered.setpoint), Command.FLY, dtype=np.int8)
        self.fleet = advance_fleet(self.fleet, Commands(flying, steered.setpoint), tick_length(self.tick, rate))
        self.tick += 1
        return moment

    def _law(self, hands: Hands, dt: float) -> tuple[Vec, Vec]:
        """Returns goals and goal velocities (B, N, 3)."""
        velocity = rotate(hands.point_velocity, -hands.yaw)
        self._links = step_links(self._links, transition_rows(self._link_kinds, dt)[self._kind_of], velocity)
        correction, rate = corrections(self._rows, self._links)
        moving = place_velocities(self._rows, correction, rate, hands.yaw, hands.yaw_rate)
        places = rotate(self._rows.offsets + correction, hands.yaw)
        by_goals, goal_velocity = np.split(self._cascade(hands, np.concatenate([places, moving], axis=2)), 2, 2)
        if self._scenario.swarm.law == "stable":
            return by_goals, goal_velocity
        return goals(self._rows, self._references(hands), correction, hands.yaw), goal_velocity

    def _cascade(self, hands: Hands, own: Vec) -> Vec:
        """Adds what is each drone's own, (B, N, 6), to the weighted sum over its references, level by level."""
        found = np.concatenate([np.concatenate([hands.point, hands.point_velocity], axis=2), own], axis=1)
        for level in self._levels:
            found[:, 1 + level.rows] += np.einsum("kr,bkrc->bkc", level.weights, found[:, level.references])
        return found[:, 1:]

    def _references(self, hands: Hands) -> Vec:
        """Returns mapped hands and bodies (B, 1 + N, 3)."""
        bodies = self.fleet.position.reshape(self._shape).copy()
        if self._scenario.formation.height_from == "hand":
            bodies[..., 2] = hands.point[..., 2] + self._formation.rest[:, 2]
        return np.concatenate([hands.point, bodies], axis=1)

    def _around(self, hands: Hands) -> Surroundings:
        position, velocity = self.fleet.position, self.fleet.velocity
        one, other = near_pairs(position[:, :2], self._run_of, self._reach())
        own_hand, speed = (array[self._run_of, 0] for array in (hands.position, hands.velocity))
        return Surroundings(
            position=position,
            velocity=velocity,
            drones=Encounters(row=one, position=position[other, :2], velocity=velocity[other, :2]),
            hand=Encounters(row=np.arange(len(position)), position=own_hand[:, :2], velocity=speed[:, :2]),
            hand_speed=norm(speed),
        )

    def _reach(self) -> float:
        """Returns how far anything can matter, m.

        The field acts on the reference, which is ahead of its body; the bubble grows with the closing speed,
        at most twice the largest speed.
        """
        settings, bodies = self._scenario.avoidance.separation, self.fleet
        ahead = float(norm(self._trajectory.point - bodies.position).max())
        fastest = float(norm(bodies.velocity).max())
        return max(
            settings.radius + settings.d0 + ahead, DRONE_BUBBLE.radius + DRONE_BUBBLE.lead * 2.0 * fastest
        )


def fly_batched(scenario: Scenario, formation: Formation, samples: Sequence[HandSample]) -> Record:
    """Flies one hand with one central computer, from a hover in the rest formation.

    Args:
        scenario: The scenario.
        formation: Its formation.
        samples: One per tick, at least one, all with the wish FLY.

    Returns:
        The run.
    """
    hand = track_hand(samples, hand_settings(scenario, formation))
    batch = Batch(scenario, formation, rest_places(formation, hand)[None])
    moments = [batch.advance(hands_at([hand], tick)) for tick in range(len(samples))]
    first = [Moment(*(array[0] for array in moment)) for moment in moments]
    return make_record(formation, hand, first, formation.ids)
