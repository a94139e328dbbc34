"""Reads the hand from a ROS 1 bag, through the optional package `rosbags`."""

from pathlib import Path
from typing import Any

import numpy as np

from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.flight_folder import Track

TRANSFORM = "geometry_msgs/msg/TransformStamped"


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
    try:
        from rosbags.rosbag1 import Reader, ReaderError  # noqa: PLC0415  an optional extra
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
    except ImportError as error:
        raise ConfigError(
            f"{path}: reading a ROS bag needs the package rosbags: pip install 'swarmtouch[rosbag]'"
        ) from error
    types = get_typestore(Stores.ROS1_NOETIC)
    try:
        with Reader(path) as reader:
            transforms = sorted(c.topic for c in reader.connections if c.msgtype == TRANSFORM)
            chosen = [c for c in reader.connections if c.topic == topic and c.msgtype == TRANSFORM]
            if not chosen:
                raise ConfigError(
                    f"{path}: no transforms on topic {topic}; choose with topic= one of {', '.join(transforms)}"
                )
            rows = [
                _row(types.deserialize_ros1(raw, TRANSFORM))
                for _, _, raw in reader.messages(connections=chosen)
            ]
    except ReaderError as error:
        raise ConfigError(f"{path.absolute()}: not a readable ROS 1 bag: {error}") from error
    stamps = np.array([stamp for stamp, _ in rows], dtype=np.int64)
    # A recorder writes in order of arrival; a repeated or late stamp carries nothing that the hand did since.
    in_order = np.diff(np.maximum.accumulate(stamps), prepend=stamps[0] - 1) > 0
    numbers = np.array([numbers for _, numbers in rows], dtype=np.float64)
    return Track(stamps[in_order], numbers[in_order, :3], numbers[in_order, 3:])


def _row(message: Any) -> tuple[int, list[float]]:
    stamp, transform = message.header.stamp, message.transform
    shift, turn = transform.translation, transform.rotation
    numbers = [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z, turn.w]
    return stamp.sec * NS_PER_S + stamp.nanosec, numbers
