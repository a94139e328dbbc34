"""What a fault did to a flight, as the recorder and the referee saw it."""

from collections.abc import Collection, Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from attrs import frozen

from shared.clock import NS_PER_S
from shared.formation import Formation
from shared.messages import DroneState, Flag, Mode
from shared.topics import HAND
from tests.chaos.flight import ChaosFlight
from tests.integration.recorder import WORLD

ALARMS = Flag(sum(Flag)) ^ (Flag.AVOIDING | Flag.FENCE | Flag.EXTRAPOLATING)
"""Flags that say that something is wrong, and not just late."""


@frozen
class Watch:
    """What happened since a fault.

    Attributes:
        flight: The flight.
        start_ns: When the fault began, on the clock of all processes of this machine.
        drones: Whom to look at: the healthy ones.
    """

    flight: ChaosFlight
    start_ns: int
    drones: tuple[int, ...]

    def states(self, drone: int) -> list[DroneState]:
        """Returns the states of one drone since the fault."""
        return self.flight.recorder.since(drone, self.start_ns)

    def cue(self, token: str) -> float | None:
        """Returns how long the loss of a process's presence took to be seen, s; None if it was not."""
        seen = [t for t, name, there in self.flight.recorder.presence if name == token and not there]
        return next(((t - self.start_ns) / NS_PER_S for t in seen if t >= self.start_ns), None)

    def alarm(self, flags: Flag = ALARMS) -> float | None:
        """Returns how long it took until some healthy drone raised a flag it had not raised before, s."""
        first = [self._alarm_of(drone, flags) for drone in self.drones]
        return min((t for t in first if t is not None), default=None)

    def modes(self, drone: int) -> tuple[Mode, ...]:
        """Returns the modes of one drone since the fault, in order."""
        modes = [state.mode for state in self.states(drone)]
        return tuple(modes[:1]) + tuple(b for a, b in pairwise(modes) if a is not b)

    def flags(self) -> Flag:
        """Returns every alarm that a healthy drone has raised."""
        raised = Flag(0)
        for drone in self.drones:
            for state in self.states(drone):
                raised |= state.flags & ALARMS
        return raised

    def behaviour(self) -> str:
        """Says who did what: modes in order by drones, and the flags raised."""
        by_modes: dict[tuple[Mode, ...], list[int]] = {}
        for drone in self.drones:
            by_modes.setdefault(self.modes(drone), []).append(drone)
        words = [f"{','.join(map(str, drones))} {'-'.join(modes)}" for modes, drones in by_modes.items()]
        return "; ".join([*words, *([str(self.flags().name)] if self.flags() else [])])

    def drift(self, drones: Collection[int], seconds: tuple[float, float]) -> float:
        """Returns how far any of these was from where it was at the begin of an interval, horizontally, m."""
        begin, end = (self.start_ns + round(t * NS_PER_S) for t in seconds)
        worst = 0.0
        for drone in drones:
            places = np.array([s.position[:2] for s in self.states(drone) if begin <= s.step_ns <= end])
            worst = max(worst, float(np.linalg.norm(places - places[0], axis=1).max()))
        return worst

    def geometry_error(self, drones: Sequence[int]) -> float:
        """Returns the largest relative deviation of the distances between drones, now, from the rest shape."""
        formation, recorder = self.flight.formation, self.flight.recorder
        now = np.array([recorder.latest(drone).position for drone in drones])
        rest = np.array([formation.rest[formation.row(drone)] for drone in drones])
        return float(np.abs(_gaps(now) / _gaps(rest) - 1.0).max())

    def ages(self, pairs: Collection[tuple[str, int]]) -> npt.NDArray[np.float64]:
        """Returns the ages of the data that steps used, s: from the sender's stamp to the receiver's step.

        Args:
            pairs: Key and receiver.
        """
        stamps = self._stamps()
        return np.array(
            [
                (state.step_ns - stamps[key, heard.epoch, heard.seq]) / NS_PER_S
                for key, drone in pairs
                for state in self.states(drone)
                if (heard := state.heard.get(key)) and (key, heard.epoch, heard.seq) in stamps
            ]
        )

    def unused(self) -> tuple[int, int]:
        """Counts samples of its inputs that a healthy drone never used: lost, or overtaken; of how many."""
        lost = total = 0
        for drone in self.drones:
            for one, next_one in pairwise(self.states(drone)):
                for key, heard in next_one.heard.items():
                    before = one.heard.get(key)
                    if before is not None and before.epoch == heard.epoch:
                        lost += max(0, heard.seq - before.seq - 1)
                        total += max(0, heard.seq - before.seq)
        return lost, total

    def tracking_rms(self) -> float:
        """Returns the RMS distance of healthy drones from their places in the ideal formation, m.

        The ideal formation stands at rest around the hand as it is at that moment (all links relaxed, no lag).
        """
        formation = self.flight.formation
        hands = sorted(self.flight.recorder.hands.values(), key=lambda hand: hand.stamp_ns)
        times = np.array([hand.stamp_ns for hand in hands])
        places = np.array([hand.position for hand in hands])
        squares = []
        for drone in self.drones:
            states = [s for s in self.states(drone) if s.mode is Mode.FOLLOW]
            at = np.searchsorted(times, [s.step_ns for s in states]).clip(max=len(times) - 1)
            ideal = places[at] + formation.rest[formation.row(drone)]
            squares.append(((np.array([s.position for s in states]) - ideal)[:, :2] ** 2).sum(axis=1))
        return float(np.sqrt(np.concatenate(squares).mean()))

    def referee(self) -> dict[str, float]:
        """Returns what the simulated world has seen since its start."""
        return self.flight.recorder.statuses[WORLD].metrics

    def _alarm_of(self, drone: int, flags: Flag) -> float | None:
        states = self.states(drone)
        raised = states[0].flags if states else Flag(0)
        return next(
            ((s.step_ns - self.start_ns) / NS_PER_S for s in states if s.flags & flags & ~raised.value), None
        )

    def _stamps(self) -> dict[tuple[str, int, int], int]:
        recorder = self.flight.recorder
        stamps = {(HAND.key(), hand.epoch, hand.seq): hand.stamp_ns for hand in recorder.hands.values()}
        for drone, states in recorder.states.items():
            stamps |= {(f"drone/{drone}/state", s.epoch, s.seq): s.stamp_ns for s in states}
        return stamps


def _gaps(places: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    one, other = np.triu_indices(len(places), k=1)
    return np.asarray(np.linalg.norm(places[one] - places[other], axis=1))


def references(formation: Formation, drones: Collection[int]) -> list[tuple[str, int]]:
    """Returns (key, receiver) of everything that these drones use of each other and of the hand."""
    return [
        *(
            (f"drone/{other}/state", drone)
            for drone in drones
            for other in formation.references(drone)
            if other in drones
        ),
        *((HAND.key(), drone) for drone in drones),
    ]
