"""The world's clock: takes commands, advances all bodies, tells their drivers and the referee."""

import numpy as np

from agents.vehicles.bodies.fleet import Fleet, advance_fleet
from agents.vehicles.bodies.state import Vec
from agents.vehicles.world.faults import Faults, faults_of
from agents.vehicles.world.radio import Radio
from agents.vehicles.world.referee import Rules, report, start_referee, update
from shared.scenario import VehicleSettings

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
        faults: What fails; None for nothing.

    Attributes:
        fleet: The bodies at the last tick.
        ticks: Ticks so far.
        lost_time: Simulated time given up because the machine was too slow, s.
    """

    def __init__(
        self, fleet: Fleet, radio: Radio, rules: Rules, now: float, faults: Faults | None = None
    ) -> None:
        self.fleet = fleet
        self.ticks = 0
        self.lost_time = 0.0
        self._radio = radio
        self._rules = rules
        self._faults = faults or faults_of([VehicleSettings()] * len(fleet.ids))
        self._flown = np.zeros(len(fleet.ids))
        self._referee = start_referee(rules)
        self._start = self._next = now
        # Poses of a restarted world must not repeat the numbers of the one before.
        self._first_seq = int(now / TICK)

    @property
    def next_tick(self) -> float:
        """Monotonic time at which `run_until` has work, s."""
        return self._next + TICK

    def run_until(self, now: float, hand: Vec | None = None) -> None:
        """Makes every tick that is due.

        Args:
            now: Monotonic time, s.
            hand: (3,) the hand in the world frame, m; None if unknown.
        """
        self._radio.receive(now)
        behind = now - self._next - MAX_CATCH_UP * TICK
        if behind > 0.0:
            self.lost_time += behind
            self._next += behind
        # Half a nanosecond: a tick is due even if summing up its time was rounded up.
        while self.next_tick <= now + 5e-10:
            self._next = self.next_tick
            self._tick(self._next, hand)

    def metrics(self) -> dict[str, float]:
        """Returns the referee's numbers and the world's own."""
        return {**report(self._referee), "lost_time_s": self.lost_time}

    def _tick(self, now: float, hand: Vec | None) -> None:
        self.fleet = advance_fleet(self.fleet, self._radio.commands(now), TICK)
        t = now - self._start
        self._flown += TICK * self.fleet.airborne
        charge, mute = self._faults.left(self._flown), self._faults.mute(t)
        self._radio.send(self.fleet, charge, mute, self._first_seq + self.ticks)
        self._referee = update(
            self._rules, self._referee, self.fleet.position, self.fleet.airborne, hand=hand, t=t
        )
        self.ticks += 1
