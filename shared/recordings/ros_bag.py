"""Reads stamped poses from a ROS 1 bag, through the optional package `rosbags`."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.recordings.track import Stamps, Track

TRANSFORM = "geometry_msgs/msg/TransformStamped"
POSE = "geometry_msgs/msg/PoseStamped"


class BagTrack(NamedTuple):
    """A topic of stamped poses.

    Attributes:
        track: The poses, at the stamps of their source.
        arrival_ns: (n,) when each arrived at the recorder, ns.
    """

    track: Track
    arrival_ns: Stamps


class _Row(NamedTuple):
    stamp_ns: int
    arrival_ns: int
    numbers: list[float]


def read_bag(path: Path, topic: str) -> Track:
    """Reads a topic of stamped transforms.

    Args:
        path: ROS 1 bag.
        topic: Topic of the hand.

    Returns:
        The hand, at the stamps of its source.

    Raises:
        ConfigError: `rosbags` is not installed, the bag is broken, or it has no such topic.
    """
    rows = [row for _, row in _read(path, TRANSFORM, topic)]
    if not rows:
        raise ConfigError(f"{path}: no transforms on topic {topic}")
    return _track(rows).track


def read_bag_tracks(path: Path) -> dict[str, BagTrack]:
    """Reads every topic of stamped transforms and stamped poses, by topic.

    Raises:
        ConfigError: `rosbags` is not installed, or the bag is broken.
    """
    rows: dict[str, list[_Row]] = {}
    for kind in (TRANSFORM, POSE):
        for topic, row in _read(path, kind):
            rows.setdefault(topic, []).append(row)
    return {topic: _track(found) for topic, found in rows.items()}


def _read(path: Path, kind: str, topic: str | None = None) -> Iterator[tuple[str, _Row]]:
    """Yields the rows of one topic, or of every topic of a type, in the order of arrival."""
    try:
        from rosbags.rosbag1 import Reader  # noqa: PLC0415  an optional extra
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
    except ImportError as error:
        raise ConfigError(
            f"{path}: reading a ROS bag needs the package rosbags: pip install 'swarmtouch[rosbag]'"
        ) from error
    types = get_typestore(Stores.ROS1_NOETIC)
    try:
        with Reader(path) as reader:
            connections = [c for c in reader.connections if c.msgtype == kind]
            chosen = [c for c in connections if topic in (None, c.topic)]
            if topic is not None and not chosen:
                found = ", ".join(sorted(c.topic for c in connections))
                raise ConfigError(f"{path}: no transforms on topic {topic}; choose with topic= one of {found}")
            # An empty choice would mean every connection to the reader.
            for connection, arrival_ns, raw in reader.messages(connections=chosen) if chosen else ():
                yield connection.topic, _row(types.deserialize_ros1(raw, kind), arrival_ns)
    except ConfigError:
        raise
    except Exception as error:  # the package checks the frame of a bag, not what its records say
        raise ConfigError(f"{path.absolute()}: not a readable ROS 1 bag: {error}") from error


def _track(rows: list[_Row]) -> BagTrack:
    stamps = np.array([row.stamp_ns for row in rows], dtype=np.int64)
    # A recorder writes in order of arrival; a repeated or late stamp carries nothing new.
    in_order = np.diff(np.maximum.accumulate(stamps), prepend=stamps[0] - 1) > 0
    numbers = np.array([row.numbers for row in rows], dtype=np.float64)
    arrivals = np.array([row.arrival_ns for row in rows], dtype=np.int64)
    track = Track(stamps[in_order], numbers[in_order, :3], numbers[in_order, 3:])
    return BagTrack(track, arrivals[in_order])


def _row(message: Any, arrival_ns: int) -> _Row:
    stamp = message.header.stamp
    if hasattr(message, "transform"):
        place, turn = message.transform.translation, message.transform.rotation
    else:
        place, turn = message.pose.position, message.pose.orientation
    numbers = [place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]
    return _Row(stamp.sec * NS_PER_S + stamp.nanosec, arrival_ns, numbers)
