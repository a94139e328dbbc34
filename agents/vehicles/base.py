"""What every vehicle is to its agent."""

from typing import Protocol

from msgspec import Struct

from shared.messages import Vector


class Pose(Struct, frozen=True):
    """A vehicle's own report.

    Attributes:
        position: World frame, m.
        velocity: World frame, m/s.
        yaw: About z, rad.
        battery: Charge, 0..1.
        airborne: Whether it is clear of the ground.
        seq: Changes with every report.
    """

    position: Vector
    velocity: Vector
    yaw: float
    battery: float
    airborne: bool
    seq: int


class Vehicle(Protocol):
    """One drone's body, simulated or real; no call ever blocks or raises because it is out of reach.

    A vehicle that hears no command for a while does what its own link-loss rule says, so the agent repeats
    its command in every step.
    """

    def pose(self) -> Pose | None:
        """Returns the newest report, None before the first; the caller notes the time when `seq` changes."""
        ...

    def fly(self, setpoint: Vector) -> None:
        """Flies to a position in the world frame, m."""
        ...

    def descend(self) -> None:
        """Levels and descends open-loop, for when the pose is lost."""
        ...

    def idle(self) -> None:
        """Keeps the motors off on the ground; in the air the same as `descend`."""
        ...

    def stop(self) -> None:
        """Cuts the motors at any height: emergency."""
        ...

    def close(self) -> None:
        """Releases the link; the vehicle's link-loss rule takes over. May be called twice."""
        ...
