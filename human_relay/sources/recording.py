"""Recorded hands: `recording:PATH?speed=..&lead=..`, sample by sample at the pace of the recording.

PATH is a flight folder (`glove.csv.gz`), a ROS 1 bag (`.bag`, `topic=` names the hand) or a CSV file with
the header `t,x,y,z[,yaw]` (s, m, rad). `speed` scales the pace and with it the velocity; `lead` (s) is a rest
at the first pose in which the drones take off. The yaw is relative to the first sample's.
"""

import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from human_relay.sources.base import HandPose
from human_relay.sources.playback import PERIOD_NS, Playback
from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.messages import Wish
from shared.recordings.csv_table import read_rows, read_table
from shared.recordings.flight_folder import (
    HAND_FILE,
    check_increasing,
    read_meta,
    read_obstacles,
    read_track,
)
from shared.recordings.track import Stamps, Track, Vec
from shared.uri import Uri

BAG_TOPIC = "/vicon/glove/glove"


class RecordedHand(Playback):
    """The `recording:` backend."""

    def __init__(self, uri: Uri, start_ns: int) -> None:
        """Reads the whole recording.

        Raises:
            ConfigError: Unknown option, or a file that is missing or wrong.
        """
        uri.refuse_unknown("speed", "lead", "topic")
        # Slower than 0.2, a 60 Hz recording has gaps that stand for a lost hand; faster than 4 is no hand.
        speed = uri.number("speed", 1.0, low=0.2, high=4.0)
        lead_ns = int(uri.number("lead", 4.0, low=0.0, high=60.0) * NS_PER_S)
        track = read_recording(_path(uri), uri.options.get("topic", BAG_TOPIC))
        t_ns = start_ns + lead_ns + ((track.t_ns - track.t_ns[0]) / speed).astype(np.int64)
        super().__init__(_poses(start_ns, t_ns, track.position, relative_yaw(track.quaternion)))

    @staticmethod
    def hints(uri: Uri) -> dict[str, object]:
        """A flight folder knows the law that flew (`base = clip(c + gain * hand_xy)`) and its columns.

        `hand.home` is where that law puts the first hand position, before any obstacle.

        Raises:
            ConfigError: There is nothing at the path, or a file of the folder is missing or wrong.
        """
        path = _path(uri)
        _check_exists(path)
        if not path.is_dir():
            return {}
        meta, obstacles = read_meta(path), read_obstacles(path)
        first = read_track(path / HAND_FILE).position[0, :2]
        home = np.clip(np.array(meta.offset) + meta.gain * first, meta.low, meta.high)
        return {
            "hand.mapping": "relative",
            "hand.gain": meta.gain,
            "hand.offset": [*meta.offset, 0.0],
            "hand.home": home.tolist(),
            "hand.clip": {"min": list(meta.low), "max": list(meta.high)},
            "obstacles": [{"name": o.name, "x": o.x, "y": o.y} for o in obstacles],
        }


def read_recording(path: Path, topic: str = BAG_TOPIC) -> Track:
    """Reads a recorded hand of any of the formats.

    Args:
        path: Flight folder, ROS 1 bag or CSV file.
        topic: Topic of the hand in a bag.

    Raises:
        ConfigError: There is nothing, or nothing readable, at the path.
    """
    _check_exists(path)
    if path.is_dir():
        return read_track(path / HAND_FILE)
    if path.suffix == ".bag":
        from shared.recordings.ros_bag import read_bag  # noqa: PLC0415  rosbags is an optional extra

        return read_bag(path, topic)
    return read_csv(path)


def _check_exists(path: Path) -> None:
    if not path.exists():
        raise ConfigError(
            f"{path.absolute()}: no such recording; expected a flight folder, a .bag file"
            " or a CSV file with the header t,x,y,z[,yaw]"
        )


def read_csv(path: Path) -> Track:
    """Reads `t,x,y,z[,yaw]` (s, m, rad).

    Raises:
        ConfigError: Names the file and the row.
    """
    has_yaw = "yaw" in read_rows(path)[0]
    _, numbers = read_table(path, numbers=("t", "x", "y", "z", *(("yaw",) if has_yaw else ())))
    t_ns = np.rint((numbers[:, 0] - numbers[0, 0]) * NS_PER_S).astype(np.int64)
    half_yaw = numbers[:, 4] / 2 if has_yaw else np.zeros(len(numbers))
    zero = np.zeros_like(half_yaw)
    quaternion = np.column_stack((zero, zero, np.sin(half_yaw), np.cos(half_yaw)))
    return Track(check_increasing(path, t_ns), numbers[:, 1:4], quaternion)


def relative_yaw(quaternion: Vec) -> Vec:
    """Returns the heading about z relative to the first sample.

    Args:
        quaternion: (n, 4) x, y, z, w.

    Returns:
        (n,) rad, without jumps of a turn; the first is 0.
    """
    x, y, z, w = quaternion.T
    yaw = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    relative: Vec = yaw - yaw[0]
    return relative


def _path(uri: Uri) -> Path:
    if not uri.path:
        raise ConfigError(f"{uri.text}: no path; for example recording:flights/S2_visual_1")
    return Path(uri.path).expanduser()


def _poses(start_ns: int, t_ns: Stamps, position: Vec, yaw: Vec) -> Iterator[HandPose]:
    lead_ns = int(t_ns[0]) - start_ns
    count = lead_ns // PERIOD_NS
    rest = [start_ns + lead_ns * k // count for k in range(count)]
    first = position[:1].tolist() * len(rest)
    stamps = itertools.chain(rest, t_ns.tolist())
    places = itertools.chain(first, position.tolist())
    headings = itertools.chain([0.0] * len(rest), yaw.tolist())
    for t, (x, y, z), heading in zip(stamps, places, headings, strict=True):
        yield HandPose(position=(x, y, z), yaw=heading, mode=Wish.FLY, t_ns=t)
