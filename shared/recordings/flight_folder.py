"""Reads a folder of a recorded flight: hand, drones, set-points, obstacles and what is known of its law.

The layout is that of the recordings of the original experiments: `glove.csv.gz`, `cf1..3.csv.gz`,
`cf1..3_sp.csv.gz`, `obstacles.csv`, `meta.json`, `pattern_topic.csv.gz` where patterns were felt. Metres,
nanoseconds since the epoch, quaternions x, y, z, w, world frame z up.
"""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
from attrs import frozen

from shared.errors import ConfigError
from shared.recordings.csv_table import LARGEST, read_rows, read_table
from shared.recordings.track import Stamps, Track, Vec
from shared.scenario import Obstacle, Pair

HAND_FILE = "glove.csv.gz"
PATTERN_FILE = "pattern_topic.csv.gz"


class Setpoints(NamedTuple):
    """Recorded set-points of one drone.

    Attributes:
        t_ns: (n,) source stamps, strictly increasing, irregular, ns.
        position: (n, 3) world frame, m.
    """

    t_ns: Stamps
    position: Vec


@frozen(kw_only=True)
class Meta:
    """What `meta.json` says about the law that flew.

    Attributes:
        run: Name of the run.
        offset: c of `base = clip(c + gain * hand_xy)`, m.
        gain: Factor on the hand's position.
        side: Edge l of the triangle of drones, m.
        height_factor: Height of that triangle over its edge.
        obstacle_radius: Radius of the circle that set-points are kept out of, m.
        low: Lower corner of the clip box (x, y), m.
        high: Upper corner of the clip box (x, y), m.
    """

    run: str
    offset: Pair
    gain: float
    side: float
    height_factor: float
    obstacle_radius: float
    low: Pair
    high: Pair


def read_track(path: Path) -> Track:
    """Reads `glove.csv.gz` or `cf<i>.csv.gz`.

    Raises:
        ConfigError: Names the file and the row.
    """
    stamps, numbers = read_table(path, integers=("t_ns",), numbers=("x", "y", "z", "qx", "qy", "qz", "qw"))
    return Track(check_increasing(path, stamps[:, 0]), numbers[:, :3], numbers[:, 3:])


def read_setpoints(path: Path) -> Setpoints:
    """Reads `cf<i>_sp.csv.gz`.

    Raises:
        ConfigError: Names the file and the row.
    """
    stamps, numbers = read_table(path, integers=("t_ns",), numbers=("x", "y", "z"))
    return Setpoints(check_increasing(path, stamps[:, 0]), numbers)


def read_arrivals(path: Path) -> Stamps:
    """Reads when each row of `cf<i>.csv.gz` or `glove.csv.gz` arrived at the recorder, (n,) ns.

    Raises:
        ConfigError: Names the file and the row.
    """
    return read_table(path, integers=("t_bag_ns",))[0][:, 0]


def read_patterns(folder: Path) -> tuple[tuple[int, str], ...]:
    """Reads the patterns that the operator felt: arrival at the recorder (ns) and name; none if felt nothing.

    Raises:
        ConfigError: Names the file and the row.
    """
    path = folder / PATTERN_FILE
    if not path.is_file():
        return ()
    stamps, _ = read_table(path, integers=("t_bag_ns",))
    # A row without a name is a tick of the original loop at which nothing was played.
    return tuple((t, name) for t, name in zip(stamps[:, 0].tolist(), _names(path), strict=True) if name)


def read_obstacles(folder: Path) -> tuple[Obstacle, ...]:
    """Reads the columns of a flight at their median places, in the order in which the law handled them.

    Raises:
        ConfigError: Names the file and the row.
    """
    path = folder / "obstacles.csv"
    _, places = read_table(path, numbers=("median_x", "median_y"))
    return tuple(
        Obstacle(name=name, x=x, y=y) for name, (x, y) in zip(_names(path), places.tolist(), strict=True)
    )


def read_meta(folder: Path) -> Meta:
    """Reads `meta.json`.

    Raises:
        ConfigError: Names the file and the key.
    """
    path = folder / "meta.json"
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ConfigError(f"{path.absolute()}: cannot be read as JSON: {error}") from error
    if not isinstance(tree, dict):
        raise ConfigError(f"{path}: an object is expected, not {type(tree).__name__}")
    (low_x, high_x), (low_y, high_y) = (_numbers(path, tree, key, 2) for key in ("limits_x", "limits_y"))
    scalars = ("pos_coef", "l", "triangle_height_factor", "R_obstacles")
    gain, side, height_factor, radius = (_numbers(path, tree, key, 1)[0] for key in scalars)
    cx, cy = _numbers(path, tree, "base_offset_c", 2)
    return Meta(
        run=str(tree.get("run", folder.name)),
        offset=(cx, cy),
        gain=gain,
        side=side,
        height_factor=height_factor,
        obstacle_radius=radius,
        low=(low_x, low_y),
        high=(high_x, high_y),
    )


def check_increasing(path: Path, t: Stamps) -> Stamps:
    """Returns the stamps if each is later than the one before.

    Raises:
        ConfigError: Names the file and the first row that is not.
    """
    late = np.flatnonzero(np.diff(t) <= 0)
    if late.size:
        raise ConfigError(f"{path}: row {int(late[0]) + 3}: the time does not increase; rows must be in order")
    return t


def _names(path: Path) -> list[str]:
    """Reads the column `name`."""
    header, *rows = read_rows(path)
    if "name" not in header:
        raise ConfigError(f"{path}: no column name, found the header {','.join(header)}")
    column = header.index("name")
    for line, row in enumerate(rows, start=2):
        if len(row) <= column:
            raise ConfigError(f"{path}: row {line}: no name")
    return [row[column] for row in rows]


def _numbers(path: Path, tree: dict[str, object], key: str, count: int) -> list[float]:
    value = tree.get(key)
    values = value if isinstance(value, list) else [value]
    numbers = [float(v) for v in values if isinstance(v, int | float) and abs(v) <= LARGEST]
    if not len(numbers) == len(values) == count:
        expected = "a number" if count == 1 else f"{count} numbers"
        raise ConfigError(f"{path}: at key {key}: {expected} expected, not {value!r}")
    return numbers
