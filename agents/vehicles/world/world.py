"""The world's clock: takes commands, advances all bodies, tells their drivers and the referee."""

from collections.abc import Mapping, Sequence

from agents.vehicles.bodies.fleet import Fleet, advance, pose_of
from agents.vehicles.world.faults import NO_FAULTS, Faults
from agents.vehicles.world.radio import Radio
from agents.vehicles.world.referee import RefereeState, Rules, report, update
from shared.cylinders import Cylinder
from shared.messages import Vector

TICK = 0.01
"""Simulated time per tick, s: poses stream at 100 Hz, bodies step finer than that."""

MAX_CATCH_UP = 10
"""Ticks made up for after a delay; what is beyond is lost, or a slow machine would never catch up."""


class World:
    """Bodies, their links and the referee, driven by `run_until`.

    Args:
        fleet: The bodies at the start.
        radio: Their links.
        rules: What the referee counts.
        now: Monotonic time of the start, s.
        faults: What fails, by drone; who is not in it does not.

    Attributes:
        fleet: The bodies at the last tick.
        ticks: Ticks so far.
        lost_time: Simulated time given up because the machine was too slow, s.
    """

    def __init__(
        self, fleet: Fleet, radio: Radio, rules: Rules, now: float, faults: Mapping[int, Faults] | None = None
    ) -> None:
        self.fleet = dict(fleet)
        self.ticks = 0
        self.lost_time = 0.0
        self._radio = radio
        self._rules = rules
        self._faults = dict.fromkeys(fleet, NO_FAULTS) | dict(faults or {})
        self._flown = dict.fromkeys(fleet, 0.0)
        self._referee = RefereeState()
        self._start = self._next = now
        # Poses of a restarted world must not repeat the numbers of the one before.
        self._first_seq = int(now / TICK)

    @property
    def next_tick(self) -> float:
        """Monotonic time at which `run_until` has work, s."""
        return self._next + TICK

    def run_until(self, now: float, hand: Vector | None = None, obstacles: Sequence[Cylinder] = ()) -> None:
        """Makes every tick that is due.

        Args:
            now: Monotonic time, s.
            hand: The hand in the world frame, m; None if unknown.
            obstacles: What moves among the drones, as it is now.
        """
        self._radio.receive(now)
        behind = now - self._next - MAX_CATCH_UP * TICK
        if behind > 0.0:
            self.lost_time += behind
            self._next += behind
        # Half a nanosecond: a tick is due even if summing up its time was rounded up.
        while self.next_tick <= now + 5e-10:
            self._next = self.next_tick
            self._tick(self._next, hand, obstacles)

    def metrics(self) -> dict[str, float]:
        """Returns the referee's numbers and the world's own."""
        return {**report(self._referee), "lost_time_s": self.lost_time}

    def _tick(self, now: float, hand: Vector | None, obstacles: Sequence[Cylinder]) -> None:
        t, seq = now - self._start, self._first_seq + self.ticks
        reports = {}
        for drone, before in self.fleet.items():
            kind, setpoint = self._radio.command(drone, now)
            self.fleet[drone] = flyer = advance(before, kind, setpoint, TICK)
            if flyer.airborne:
                self._flown[drone] += TICK
            faults = self._faults[drone]
            if not faults.mute(t):
                reports[drone] = pose_of(flyer, faults.left(self._flown[drone]), seq)
        self._radio.send(reports)
        flyers = self.fleet.values()
        positions, airborne = [f.body.position for f in flyers], [f.airborne for f in flyers]
        self._referee = update(
            self._rules, self._referee, positions, airborne, hand=hand, t=t, obstacles=obstacles
        )
        self.ticks += 1
