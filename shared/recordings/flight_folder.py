"""Reads a folder of a recorded flight: hand, drones, set-points, obstacles and what is known of its law.

The layout is that of the recordings of the original experiments: `glove.csv.gz`, `cf1..3.csv.gz`,
`cf1..3_sp.csv.gz`, `obstacles.csv`, `meta.json`, `pattern_topic.csv.gz` where patterns were felt. Metres,
nanoseconds since the epoch, quaternions x, y, z, w, world frame z up.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from attrs import frozen

from shared.errors import ConfigError
from shared.files import read_text
from shared.recordings.check import ROOM, Checked, check
from shared.recordings.csv_table import read_header, read_table
from shared.recordings.track import NO_STAMP, Found, Stamps, Track, Vec
from shared.scenario import Obstacle, Pair

HAND_FILE = "glove.csv.gz"
PATTERN_FILE = "pattern_topic.csv.gz"
LARGEST = 1_000.0
"""Size of the largest number in `meta.json`, m."""
MOST_NAMED = 100_000
"""Lines of the files that hold names."""


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


def read_body(path: Path) -> Checked:
    """Reads `glove.csv.gz` or `cf<i>.csv.gz` and checks it.

    Raises:
        ConfigError: Names the file and the line.
    """
    return _read(path, ("qx", "qy", "qz", "qw"))


def read_track(path: Path) -> Track:
    """Reads what is left of `glove.csv.gz` or `cf<i>.csv.gz`; errors as for `read_body`."""
    return read_body(path).track


def read_setpoints(path: Path) -> Setpoints:
    """Reads `cf<i>_sp.csv.gz`.

    Raises:
        ConfigError: Names the file and the line.
    """
    track = _read(path, ()).track
    return Setpoints(track.t_ns, track.position)


def _read(path: Path, turns: Sequence[str]) -> Checked:
    """Reads a table of places, by its stamps and, where it has them, its arrivals."""
    times = ("t_ns", *(("t_bag_ns",) if "t_bag_ns" in read_header(path) else ()))
    table = read_table(path, integers=times, numbers=("x", "y", "z", *turns))
    stamps = table.stamps[:, 0]
    return check(
        Found(
            t_ns=np.where(stamps == 0, NO_STAMP, stamps),
            position=table.numbers[:, :3],
            quaternion=table.numbers[:, 3:] if turns else None,
            arrival_ns=table.stamps[:, 1] if len(times) > 1 else None,
            lines=table.lines,
            remarks=table.remarks,
        ),
        str(path),
    )


def read_patterns(folder: Path) -> tuple[tuple[int, str], ...]:
    """Reads the patterns that the operator felt: arrival at the recorder (ns) and name; none if felt nothing.

    Raises:
        ConfigError: Names the file and the line.
    """
    path = folder / PATTERN_FILE
    if not path.is_file():
        return ()
    table = read_table(path, integers=("t_bag_ns",), texts=("name",), most=MOST_NAMED)
    # A row without a name is a tick of the original loop at which nothing was played.
    return tuple((t, name) for t, [name] in zip(table.stamps[:, 0].tolist(), table.texts, strict=True) if name)


def read_obstacles(folder: Path) -> tuple[Obstacle, ...]:
    """Reads the columns of a flight at their median places, in the order in which the law handled them.

    Raises:
        ConfigError: Names the file and the line.
    """
    path = folder / "obstacles.csv"
    table = read_table(path, numbers=("median_x", "median_y"), texts=("name",), most=MOST_NAMED)
    near = np.abs(table.numbers).max(axis=1) <= ROOM
    if not near.all():
        line = int(table.lines[np.flatnonzero(~near)[0]])
        raise ConfigError(f"{path}: line {line}: no place within {ROOM:g} m; expected metres")
    return tuple(
        Obstacle(name=name, x=x, y=y)
        for [name], (x, y) in zip(table.texts, table.numbers.tolist(), strict=True)
    )


def read_meta(folder: Path) -> Meta:
    """Reads `meta.json`.

    Raises:
        ConfigError: Names the file and the key.
    """
    path = folder / "meta.json"
    try:
        tree = json.loads(read_text(path))
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


def _numbers(path: Path, tree: dict[str, object], key: str, count: int) -> list[float]:
    value = tree.get(key)
    values = value if isinstance(value, list) else [value]
    numbers = [float(v) for v in values if isinstance(v, int | float) and abs(v) <= LARGEST]
    if not len(numbers) == len(values) == count:
        expected = "a number" if count == 1 else f"{count} numbers"
        raise ConfigError(f"{path}: at key {key}: {expected} expected, not {value!r:.80}")
    return numbers
