"""Finds every body in a ROS 1 bag; the optional package `rosbags` reads the messages."""

from array import array
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.recordings.bag_records import BagMessage, BagRecords
from shared.recordings.csv_rows import MOST_LINES
from shared.recordings.track import NO_STAMP, Found

MOST_BODIES = 1_000
"""In one bag: a foreign `/tf` may name as many as it likes."""

TF = "tf2_msgs/msg/TFMessage"
LARGEST_MESSAGE = 1 << 20
"""Bytes of the largest message in which poses are looked for."""

Deserialize = Callable[[bytes, str], Any]
_Pose = tuple[str, Any, Any, Any]
"""What follows the topic in a body's name, header, place, orientation or None."""


class BagBody(NamedTuple):
    """A body in a bag.

    Attributes:
        kind: Type of the messages, for example `geometry_msgs/msg/PoseStamped`.
        found: Its poses, unchecked.
    """

    kind: str
    found: Found


class BagContent(NamedTuple):
    """What is in a bag.

    Attributes:
        bodies: By topic; bodies on a topic of transforms (`/tf`) are named `<topic>:<frame>`.
        others: The topics on which there are no poses -> type.
        remarks: What could not be read, in words.
    """

    bodies: dict[str, BagBody]
    others: dict[str, str]
    remarks: tuple[str, ...]


def read_bag(path: Path) -> BagContent:
    """Reads every body on topics of stamped poses, transforms, odometry or points.

    A bag that was cut off is read up to there; that is in the remarks of what is found.

    Raises:
        ConfigError: `rosbags` is not installed, it is no ROS 1 bag, or holds more than a recording of hours.
    """
    deserialize = _deserializer()
    bag, bodies = BagRecords(path), _Bodies(path)
    try:
        for message in bag.messages(lambda connection: connection.kind in _POSES):
            bodies.add(message, deserialize)
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path.absolute()}: not a readable ROS 1 bag: {error}") from error
    remarks = _remarks(path, bag, bodies)
    return BagContent(
        {name: BagBody(body.kind, body.found(remarks)) for name, body in bodies.found.items()},
        {each.topic: each.kind for each in bag.connections.values() if each.kind not in _POSES},
        remarks,
    )


class _Bodies:
    """Collects the poses of all bodies."""

    def __init__(self, path: Path) -> None:
        self.found: dict[str, _Body] = {}
        self.unreadable = self.refused = 0
        self._path = path
        self._count = 0

    def add(self, message: BagMessage, deserialize: Deserialize) -> None:
        topic, kind = message.connection
        try:
            if len(message.data) > LARGEST_MESSAGE:
                raise ValueError
            poses = list(_POSES[kind](deserialize(message.data, kind)))
        except Exception:  # noqa: BLE001  the package raises whatever it stumbles over
            self.unreadable += 1
            return
        for name, header, place, turn in poses:
            body = self.found.get(topic + name)
            if body is None and len(self.found) < MOST_BODIES:
                body = self.found[topic + name] = _Body(kind)
            if body:
                body.add(header, message.arrival_ns, place, turn)
            self.refused += body is None
        self._count += len(poses)
        if self._count > MOST_LINES:
            raise ConfigError(f"{self._path}: more than {MOST_LINES} poses; take a part of it: rosbag filter")


class _Body:
    """Collects the poses of one body in little memory."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self._times, self._numbers = array("q"), array("d")

    def add(self, header: Any, arrival_ns: int, place: Any, turn: Any) -> None:
        stamp_ns = header.stamp.sec * NS_PER_S + header.stamp.nanosec
        self._times.extend((stamp_ns or NO_STAMP, arrival_ns))
        self._numbers.extend((place.x, place.y, place.z))
        self._numbers.extend((turn.x, turn.y, turn.z, turn.w) if turn else (0.0, 0.0, 0.0, 0.0))

    def found(self, remarks: tuple[str, ...]) -> Found:
        times = np.array(self._times, dtype=np.int64).reshape(-1, 2)
        numbers = np.array(self._numbers, dtype=np.float64).reshape(-1, 7)
        # A bag keeps no order of its messages; those who read one sort them by arrival.
        order = np.argsort(times[:, 1], kind="stable")
        times, numbers = times[order], numbers[order]
        return Found(
            t_ns=times[:, 0],
            position=numbers[:, :3],
            quaternion=numbers[:, 3:],
            arrival_ns=times[:, 1],
            remarks=remarks,
        )


@cache
def _deserializer() -> Deserialize:
    try:
        from rosbags.typesys import (  # noqa: PLC0415  an optional extra
            Stores,
            get_types_from_msg,
            get_typestore,
        )
    except ImportError as error:
        raise ConfigError(
            "reading a ROS bag needs the package rosbags: pip install 'swarmtouch[rosbag]'"
        ) from error
    types = get_typestore(Stores.ROS1_NOETIC)
    types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))
    return types.deserialize_ros1


def _remarks(path: Path, bag: BagRecords, bodies: _Bodies) -> tuple[str, ...]:
    told = {
        f"read up to byte {bag.cut_at} of {path.stat().st_size}: it is cut off there": bag.cut_at is not None,
        f"damaged chunks were skipped: {bag.damaged}": bag.damaged > 0,
        f"messages could not be read: {bodies.unreadable}": bodies.unreadable > 0,
        f"{bodies.refused} poses of more than {MOST_BODIES} bodies were left out": bodies.refused > 0,
    }
    return tuple(text for text, is_so in told.items() if is_so)


def _transforms(message: Any) -> Iterator[_Pose]:
    for each in message.transforms:
        yield f":{each.child_frame_id}", each.header, each.transform.translation, each.transform.rotation


_POSES: dict[str, Callable[[Any], Iterator[_Pose]]] = {
    "geometry_msgs/msg/TransformStamped": lambda m: iter(
        [("", m.header, m.transform.translation, m.transform.rotation)]
    ),
    "geometry_msgs/msg/PoseStamped": lambda m: iter([("", m.header, m.pose.position, m.pose.orientation)]),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: iter(
        [("", m.header, m.pose.pose.position, m.pose.pose.orientation)]
    ),
    "nav_msgs/msg/Odometry": lambda m: iter([("", m.header, m.pose.pose.position, m.pose.pose.orientation)]),
    "geometry_msgs/msg/PointStamped": lambda m: iter([("", m.header, m.point, None)]),
    TF: _transforms,
}
"""Type of a message -> the poses in it."""
