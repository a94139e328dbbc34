"""ROS 1 bags made for tests, by the package `rosbags`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from shared.clock import NS_PER_S

TRANSFORM = "geometry_msgs/msg/TransformStamped"
POSE = "geometry_msgs/msg/PoseStamped"
COVARIANT = "geometry_msgs/msg/PoseWithCovarianceStamped"
ODOMETRY = "nav_msgs/msg/Odometry"
POINT = "geometry_msgs/msg/PointStamped"
TF = "tf2_msgs/msg/TFMessage"
STRING = "std_msgs/msg/String"

START_NS = 1_600_000_000 * NS_PER_S
UNTURNED = (0.0, 0.0, 0.0, 1.0)

_TYPES = get_typestore(Stores.ROS1_NOETIC)
_TYPES.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))


class Stamped(NamedTuple):
    """A pose: source's stamp and arrival, ns, place, m, and orientation."""

    stamp_ns: int
    arrival_ns: int
    place: tuple[float, float, float]
    turn: tuple[float, float, float, float] = UNTURNED


class Body(NamedTuple):
    """What is said on a topic; `frame` names the body where the topic holds several."""

    kind: str
    poses: Sequence[Stamped]
    frame: str = "hand"


def steady(count: int, *, rate_hz: float = 60.0, delay_ns: int = 28_000_000) -> list[Stamped]:
    """A hand that moves along y at 0.3 m/s."""
    stamps = [START_NS + round(k * NS_PER_S / rate_hz) for k in range(count)]
    return [Stamped(t, t + delay_ns, (0.1, 0.3 * (t - START_NS) / NS_PER_S, 1.2)) for t in stamps]


def write_bag(path: Path, bodies: Mapping[str, Body], *, compression: str = "", chunk: int = 4096) -> Path:
    """Writes a bag, replacing the file; `compression` is `lz4` or `bz2`, `chunk` a size in bytes."""
    path.unlink(missing_ok=True)
    writer = Writer(path)
    writer.chunk_threshold = chunk
    if compression:
        writer.set_compression(Writer.CompressionFormat[compression.upper()])
    with writer as bag:
        for topic, body in bodies.items():
            connection = bag.add_connection(topic, body.kind, typestore=_TYPES)
            for pose in body.poses:
                message = _message(body, pose)
                bag.write(connection, pose.arrival_ns, bytes(_TYPES.serialize_ros1(message, body.kind)))
    return path


def _message(body: Body, pose: Stamped) -> Any:
    """Builds the message of a pose."""
    kinds: Any = _TYPES.types
    sec, nanosec = divmod(pose.stamp_ns, NS_PER_S)
    stamp = kinds["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    header = kinds["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="world")
    point = kinds["geometry_msgs/msg/Point"](*pose.place)
    turn = kinds["geometry_msgs/msg/Quaternion"](*pose.turn)
    placed = kinds["geometry_msgs/msg/Pose"](position=point, orientation=turn)
    covariant = kinds["geometry_msgs/msg/PoseWithCovariance"](pose=placed, covariance=np.zeros(36))
    moved = kinds["geometry_msgs/msg/Transform"](
        translation=kinds["geometry_msgs/msg/Vector3"](*pose.place), rotation=turn
    )
    transform = kinds[TRANSFORM](header=header, child_frame_id=body.frame, transform=moved)
    return {
        TRANSFORM: lambda: transform,
        POSE: lambda: kinds[POSE](header=header, pose=placed),
        COVARIANT: lambda: kinds[COVARIANT](header=header, pose=covariant),
        ODOMETRY: lambda: kinds[ODOMETRY](
            header=header, child_frame_id=body.frame, pose=covariant, twist=_still(kinds)
        ),
        POINT: lambda: kinds[POINT](header=header, point=point),
        TF: lambda: kinds[TF](transforms=[transform]),
        STRING: lambda: kinds[STRING](data="hello"),
    }[body.kind]()


def _still(kinds: Any) -> Any:
    zero = kinds["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    twist = kinds["geometry_msgs/msg/Twist"](linear=zero, angular=zero)
    return kinds["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=np.zeros(36))
