"""What travels between the processes: frozen types, SI units, world frame ENU (z up).

Every message carries an envelope: `epoch` (the publisher's start, ns; a restarted process gets a new one),
`seq` (from 0 within an epoch) and `stamp_ns` (the publisher's clock). Order and loss are judged by
`(epoch, seq)` alone. The schema version `v` is added and checked by `shared.codec`.
"""

import enum
import sys
from typing import Annotated, Any, Final, NamedTuple

from msgspec import Meta, Struct

SCHEMA_VERSION = 1

MAX_POSITION: Final = 1_000.0
MAX_VELOCITY: Final = 50.0
MAX_DRONE_ID = 65_535
MAX_RADIUS = 5.0
"""Of a moving obstacle, m."""
MAX_VALID = 60.0
"""Longest time that a moving obstacle may claim to be where it was, s."""


Vector = tuple[float, float, float]
Coordinate = Annotated[float, Meta(ge=-MAX_POSITION, le=MAX_POSITION)]
Position = tuple[Coordinate, Coordinate, Coordinate]
Speed = Annotated[float, Meta(ge=-MAX_VELOCITY, le=MAX_VELOCITY)]
Velocity = tuple[Speed, Speed, Speed]
Angle = Annotated[float, Meta(ge=-1_000.0, le=1_000.0)]
Seconds = Annotated[float, Meta(ge=0.0, le=1e9)]
Fraction = Annotated[float, Meta(ge=0.0, le=1.0)]
Finite = Annotated[float, Meta(ge=-sys.float_info.max, le=sys.float_info.max)]
UInt64 = Annotated[int, Meta(ge=0)]
"""MessagePack has no larger integers."""
DroneId = Annotated[int, Meta(ge=1, le=MAX_DRONE_ID)]

ORIGIN: Vector = (0.0, 0.0, 0.0)

NO_HAND: Vector = (0.0, 0.0, -MAX_POSITION)
"""Position in hand samples while the relay has not seen a hand yet; nobody keeps away from it or follows it."""


class Wish(enum.StrEnum):
    """What the operator wants; repeated in every hand sample, so nothing is lost without a return path."""

    GROUND = "GROUND"
    FLY = "FLY"
    HOLD = "HOLD"
    LAND = "LAND"
    STOP = "STOP"


class Mode(enum.StrEnum):
    """Flight mode of one drone (DESIGN section 5)."""

    GROUND = "GROUND"
    TAKEOFF = "TAKEOFF"
    FOLLOW = "FOLLOW"
    HOLD = "HOLD"
    LAND = "LAND"
    STOP = "STOP"


class Flag(enum.IntFlag, boundary=enum.CONFORM):
    """Conditions of a drone that the operator may have to feel."""

    EXTRAPOLATING = 1
    REPAIRED = 2
    BLOCKED = 4
    FENCE = 8
    LOW_BATTERY = 16
    CRITICAL_BATTERY = 32
    OLD_POSE = 64
    HAND_STALE = 128
    REFERENCE_LOST = 256
    REJECTED_INPUT = 512
    AVOIDING = 1024
    WAITING = 2048
    """It has not heard everybody whom it must avoid, and does not know where they are."""
    MISSED = 4096
    """Not everybody who must avoid it hears it."""

    @classmethod
    def _missing_(cls, value: object) -> Any:
        """Keeps the flags that we know of a number of 32 bits: a newer publisher may set others."""
        if not (isinstance(value, int) and 0 <= value < 2**32):
            raise ValueError(f"flags {value!r}")
        return super()._missing_(value)


class Heard(NamedTuple):
    """Which sample of a topic a step used, and when it had arrived (receiver's clock)."""

    epoch: UInt64
    seq: UInt64
    arrival_ns: UInt64


MOST_SEEN = 32
"""Of so many drones at most somebody tells where it saw them."""
MOST_LOST = 16
"""Of so many drones that it no longer hears one says at most where they were."""


class Seen(NamedTuple):
    """A drone as somebody heard it last: what it said in the state `(epoch, seq)`, `age` seconds ago."""

    id: DroneId
    epoch: UInt64
    seq: UInt64
    position: Position
    velocity: Velocity
    mode: Mode
    age: Seconds


NO_FLAGS = Flag(0)


class Message(Struct, frozen=True, kw_only=True, tag_field="v", tag=SCHEMA_VERSION):
    """Envelope of every message; `v` is written, and checked, by `shared.codec`."""

    epoch: UInt64
    seq: UInt64
    stamp_ns: UInt64


class HandSample(Message, frozen=True, kw_only=True):
    """The hand and the operator's wish; the wish is state, repeated in every sample.

    Attributes:
        position: Hand in the world frame, m; `NO_HAND` before the first.
        velocity: Hand in the world frame, m/s.
        yaw: Heading of the hand about z, rad.
        mode: The operator's wish.
        jumped: The source says that the hand is where no hand can have come: it is kept where it was believed
            last, and holds.
        signature: Ed25519 signature over key, epoch, seq and payload; None where the swarm has no key.
    """

    position: Position
    velocity: Velocity
    yaw: Angle
    mode: Wish
    jumped: bool = False
    signature: bytes | None = None


class DroneState(Message, frozen=True, kw_only=True):
    """One control step of one drone.

    Attributes:
        id: Number of the drone in the scenario.
        position: Body in the world frame, m, as the vehicle last reported it.
        velocity: Body in the world frame, m/s.
        goal: Where the control law wants the drone (before avoidance), m.
        goal_velocity: Rate of the goal from the broadcast hand velocity and the link rates, m/s.
        setpoint: What was sent to the vehicle (after avoidance and limits), m.
        mode: Flight mode.
        displacements: Impedance displacement per link into this drone, `"1-2"` -> metres, before its limit.
        pose_age: Age of the vehicle's pose when it was used, s.
        battery: Charge, 0..1.
        flags: Conditions, see `Flag`.
        heard: The inputs this step used: key -> (epoch, seq, arrival).
        unheard: Numbers of the drones that it should hear, and does not.
        lost: Where it saw those of them last whom it ever heard.
        step_ns: When the step started (publisher's clock, same as `stamp_ns` and `arrival_ns`).
        ahead: Where the body will be once its vehicle has answered (docs/safety.md), m; absent: its position.
        pace: Velocity of that point, m/s; absent: that of the body.
        asked: Acceleration of that point, which its vehicle is asked for, m/s^2.
    """

    id: DroneId
    position: Position
    velocity: Velocity
    goal: Position
    goal_velocity: Velocity
    setpoint: Position
    mode: Mode
    displacements: dict[str, Position] = {}
    pose_age: Seconds = 0.0
    battery: Fraction = 1.0
    flags: Flag = NO_FLAGS
    heard: dict[str, Heard] = {}
    unheard: tuple[DroneId, ...] = ()
    lost: tuple[Seen, ...] = ()
    step_ns: UInt64 = 0
    ahead: Position | None = None
    pace: Velocity | None = None
    asked: Velocity = ORIGIN


class Places(Message, frozen=True, kw_only=True):
    """Where a drone knows whom, heard or told by others: in a swarm in which not everybody hears everybody.

    Attributes:
        id: Number of the drone.
        seen: Itself first, then the others, the nearest of many.
    """

    id: DroneId
    seen: tuple[Seen, ...]


class ObstacleState(Message, frozen=True, kw_only=True):
    """Something that moves among the drones and does not keep away from them: a person, a robot.

    Attributes:
        id: Number of the obstacle.
        position: Middle of its foot in the world frame, m; it fills an upright cylinder above it.
        velocity: World frame, m/s.
        radius: m.
        height: m.
        valid_s: How long it may be relied on to be about there if nothing newer is heard, s.
    """

    id: DroneId
    position: Position
    velocity: Velocity
    radius: Annotated[float, Meta(ge=0.0, le=MAX_RADIUS)]
    height: Annotated[float, Meta(ge=0.0, le=MAX_POSITION)]
    valid_s: Annotated[float, Meta(ge=0.0, le=MAX_VALID)]


class FormationState(Message, frozen=True, kw_only=True):
    """State of the formation as the operator is to feel it (paper section 5.2).

    Attributes:
        area: Area of the polygon of the drones, m^2.
        area_ratio: Area over the area of the default formation.
        distances: Distance per neighbouring pair, `"1-2"` -> metres.
        extent: -1 contracted, 0 regular, +1 extended.
        trend: -1 shrinking, 0 steady, +1 growing.
        displacement: Shift of the centroid to the right of the direction of motion, m.
        missing: Drones that are not heard.
        heard: The inputs it was computed from.
    """

    area: Seconds
    area_ratio: Seconds
    distances: dict[str, Seconds]
    extent: Annotated[int, Meta(ge=-1, le=1)]
    trend: Annotated[int, Meta(ge=-1, le=1)]
    displacement: Coordinate
    missing: tuple[DroneId, ...] = ()
    heard: dict[str, Heard] = {}


class PatternEvent(Message, frozen=True, kw_only=True):
    """A tactile pattern: why, what, and how it went on the device.

    Attributes:
        pattern: Name in the pattern set.
        outcome: `started`, `finished`, `suppressed` or `failed`.
        state_seq: `seq` of the `FormationState` that caused it.
        heard: The drone and hand samples that caused it.
        started_ns: When the first frame started, 0 if it did not.
        finished_ns: When the device reported the end, 0 if it did not.
    """

    pattern: str
    outcome: str
    state_seq: UInt64
    heard: dict[str, Heard] = {}
    started_ns: UInt64 = 0
    finished_ns: UInt64 = 0


class ProcessStatus(Message, frozen=True, kw_only=True):
    """Health of one process, once a second and once more when it ends.

    Attributes:
        role: `drone`, `relay`, `world`, `bridge`, `observer`, `console`.
        id: Number within the role, 0 for single ones.
        pid: Process number on its host.
        host: Name of its machine.
        state: One word: `starting`, `running`, `degraded`, `ending`.
        rate_hz: Steps per second over the last second.
        cpu: Fraction of one core over the last second.
        rss_mb: Resident memory, MB.
        form: Form of the law that it runs, `pure` or `compiled 3f2a91c0`; empty if it runs none.
        rejected: Dropped messages by reason since the start.
        metrics: Further numbers of this role (for example the referee's distances).
    """

    role: str
    id: Annotated[int, Meta(ge=0, le=MAX_DRONE_ID)]
    pid: UInt64
    host: str
    state: str
    form: str = ""
    rate_hz: Seconds = 0.0
    cpu: Seconds = 0.0
    rss_mb: Seconds = 0.0
    rejected: dict[str, UInt64] = {}
    metrics: dict[str, Finite] = {}
