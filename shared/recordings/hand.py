"""A recorded hand, whatever it was recorded with; the format is told by the content of the file."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.recordings.check import Checked, check
from shared.recordings.csv_table import read_header, read_table
from shared.recordings.flight_folder import HAND_FILE, read_body
from shared.recordings.track import NO_STAMP, Found, Vec

BAG_TOPIC = "/vicon/glove/glove"
"""Where the hand is in the bags of the original experiments."""
LATEST_S = 4e9
"""Largest time in a table, s: up to it, until 2096, times are 64 bits of ns apart at most."""

MOST_YAW = 4.0 * np.pi
"""Largest heading in a table, rad: nobody turns on the spot twice, and degrees are soon more."""

UNITS = {"t": "s", "x": "m", "y": "m", "z": "m", "yaw": "rad"}
"""Of the columns of a table."""

_BAG = b"#ROSBAG V"
_MOST_NAMED = 20
_ROS2_FILE = "metadata.yaml"
_READ = "a hand is read from a ROS 1 bag or a CSV file"
_FOREIGN = {
    b"\x89MCAP0": "an MCAP file",
    b"SQLite format 3": "a database, as of ROS 2",
    b"PK\x03\x04": "a zip file, as of a spreadsheet",
    b"BZh": "packed by bzip2",
    b"\xfd7zXZ": "packed by xz",
    b"\x28\xb5\x2f\xfd": "packed by zstd",
    b"\x02P": "a C3D file",
}
"""What a file begins with -> what it is; hands are not read from these."""


class RecordedBody(NamedTuple):
    """What was recorded.

    Attributes:
        checked: The poses, and what was left out of them.
        remarks: That, and what else is to be known about the recording, in words.
    """

    checked: Checked
    remarks: tuple[str, ...]


def read_hand(path: Path, topic: str | None = None) -> RecordedBody:
    """Reads a recorded hand of any of the formats, and checks it.

    Args:
        path: Flight folder, ROS 1 bag, or CSV file with the header `t,x,y,z[,yaw]` (s, m, rad).
        topic: Topic of the hand in a bag; None for that of the original experiments or, if there is one body
            only, for that.

    Raises:
        ConfigError: There is nothing, nothing readable, or no hand at the path.
    """
    if not path.exists():
        raise ConfigError(
            f"{path.absolute()}: no such recording; expected a flight folder, a .bag file"
            " or a CSV file with the header t,x,y,z[,yaw]"
        )
    if path.is_dir():
        if (path / _ROS2_FILE).is_file():
            raise ConfigError(f"{path}: a bag of ROS 2; {_READ}")
        checked = read_body(path / HAND_FILE)
        return RecordedBody(checked, checked.report.remarks)
    head = _head(path)
    if head.startswith(_BAG):
        return _read_bag_hand(path, topic)
    for magic, kind in _FOREIGN.items():
        if head.startswith(magic):
            raise ConfigError(f"{path}: {kind}; {_READ}")
    checked = check(read_csv(path), str(path))
    return RecordedBody(checked, checked.report.remarks)


def read_csv(path: Path) -> Found:
    """Reads `t,x,y,z[,yaw]` (s, m, rad).

    Raises:
        ConfigError: Names the file and the line.
    """
    has_yaw = "yaw" in read_header(path)
    numbers = ("t", "x", "y", "z", *(("yaw",) if has_yaw else ()))
    table = read_table(path, numbers=numbers, units=UNITS)
    t, half_yaw = table.numbers[:, 0], table.numbers[:, 4] / 2 if has_yaw else None
    said = np.abs(t) <= LATEST_S
    if 2 * np.count_nonzero(said) < np.count_nonzero(np.isfinite(t)):
        raise ConfigError(
            f"{path}: times beyond {LATEST_S:.0e} s; are they milli- or nanoseconds? Write seconds"
        )
    first = t[said][0] if said.any() else 0.0
    t_ns = np.rint(np.where(said, t - first, 0.0) * NS_PER_S).astype(np.int64)
    quaternion = None
    if half_yaw is not None:
        if _most(half_yaw) > MOST_YAW / 2:
            raise ConfigError(f"{path}: headings beyond {MOST_YAW:.1f} rad; are they degrees? Write radians")
        zero = np.zeros_like(half_yaw)
        with np.errstate(invalid="ignore"):
            quaternion = np.column_stack((zero, zero, np.sin(half_yaw), np.cos(half_yaw)))
    return Found(
        t_ns=np.where(said, t_ns, NO_STAMP),
        position=table.numbers[:, 1:4],
        quaternion=quaternion,
        lines=table.lines,
        remarks=table.remarks,
    )


def relative_yaw(quaternion: Vec) -> Vec:
    """Returns the heading about z relative to the first sample.

    Args:
        quaternion: (n, 4) x, y, z, w.

    Returns:
        (n,) rad, without jumps of a turn; the first is 0.
    """
    x, y, z, w = quaternion.T
    yaw = np.unwrap(np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z))
    relative: Vec = yaw - yaw[0]
    return relative


def _most(values: Vec) -> float:
    """Returns the largest magnitude, whatever else stands there."""
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as stream:
            return stream.read(16)
    except OSError as error:
        raise ConfigError(f"{path.absolute()}: cannot be read: {error}") from error


def _read_bag_hand(path: Path, topic: str | None) -> RecordedBody:
    from shared.recordings.ros_bag import read_bag  # noqa: PLC0415  rosbags is an optional extra

    bodies, others, unread = read_bag(path)
    chosen, remarks = topic or BAG_TOPIC, tuple[str, ...]()
    if topic is None and chosen not in bodies and len(bodies) == 1:
        (chosen,) = bodies
        remarks = (f"the hand is {chosen}, the only body in it",)
    if chosen not in bodies:
        known = {name: body.kind for name, body in bodies.items()} or others
        shown = ", ".join(f"{name} ({kind})" for name, kind in sorted(known.items())[:_MOST_NAMED])
        if len(known) > _MOST_NAMED:
            shown += f" and {len(known) - _MOST_NAMED} more"
        hint = "choose with topic= one of" if bodies else "there are no poses in it, but"
        what = f"{hint} {shown}" if known else "nothing is in it"
        why = "".join(f"; {remark}" for remark in unread)
        raise ConfigError(f"{path}: no hand on topic {chosen}; {what}{why}")
    checked = check(bodies[chosen].found, f"{path}, {chosen}")
    return RecordedBody(checked, (*remarks, *checked.report.remarks))
