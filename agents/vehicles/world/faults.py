"""Faults that a scenario injects into a simulated vehicle: a battery that drains, poses that stay away."""

import math

from attrs import frozen

from shared.scenario import VehicleSettings


@frozen(kw_only=True)
class Faults:
    """Of one vehicle.

    Attributes:
        charge: At the start, 0..1.
        endurance: Flying time from full to empty, s; infinite for a battery that never drains.
        mute_from: When the pose stops coming, s from the start of the world; infinite for never.
        mute_until: When it comes again, s.
    """

    charge: float
    endurance: float
    mute_from: float
    mute_until: float

    def left(self, flown: float) -> float:
        """Returns the charge, 0..1, after some time in the air, s."""
        return min(max(self.charge - flown / self.endurance, 0.0), 1.0)

    def mute(self, t: float) -> bool:
        """Says whether the pose stays away at a time (s from the start)."""
        return self.mute_from <= t < self.mute_until


def faults_of(settings: VehicleSettings) -> Faults:
    """Returns the faults of a vehicle; what a scenario does not name does not fail."""
    start, length = settings.pose_silence or (math.inf, 0.0)
    return Faults(
        charge=1.0 if settings.battery is None else settings.battery,
        endurance=math.inf if settings.endurance is None else settings.endurance,
        mute_from=start,
        mute_until=start + length,
    )


NO_FAULTS = faults_of(VehicleSettings())
