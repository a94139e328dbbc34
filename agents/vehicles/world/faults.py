"""Faults that a scenario injects into simulated vehicles: batteries that drain, poses that stay away."""

import numpy as np
from attrs import field, frozen

from agents.vehicles.bodies.state import Mask, Vec
from shared.scenario import VehicleSettings


@frozen(kw_only=True)
class Faults:
    """One row per simulated drone.

    Attributes:
        charge: (N,) charge at the start, 0..1.
        endurance: (N,) flying time from full to empty, s; infinite for a battery that never drains.
        mute_from: (N,) when the pose stops coming, s from the start of the world; infinite for never.
        mute_until: (N,) when it comes again, s.
    """

    charge: Vec = field(eq=False)
    endurance: Vec = field(eq=False)
    mute_from: Vec = field(eq=False)
    mute_until: Vec = field(eq=False)

    def left(self, flown: Vec) -> Vec:
        """Returns the charges (N,), 0..1.

        Args:
            flown: (N,) time in the air so far, s.
        """
        return np.clip(self.charge - flown / self.endurance, 0.0, 1.0)

    def mute(self, t: float) -> Mask:
        """Returns whose pose does not come at a time (s from the start)."""
        return (self.mute_from <= t) & (t < self.mute_until)


def faults_of(settings: list[VehicleSettings]) -> Faults:
    """Returns the faults of some vehicles; what a scenario does not name does not fail."""
    silence = np.array([s.pose_silence or (np.inf, 0.0) for s in settings]).reshape(-1, 2)
    return Faults(
        charge=np.array([1.0 if s.battery is None else s.battery for s in settings]),
        endurance=np.array([np.inf if s.endurance is None else s.endurance for s in settings]),
        mute_from=silence[:, 0],
        mute_until=silence.sum(axis=1),
    )
