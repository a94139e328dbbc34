"""Flight folders made for tests: a triangle of drones behind a hand that goes to and fro."""

import gzip
import json
import math
from collections.abc import Callable, Iterable
from pathlib import Path

from shared.clock import NS_PER_S

SIDE, HEIGHT = 0.4, 0.344
OFFSETS = {"cf1": (0.0, 0.0), "cf2": (-HEIGHT, SIDE / 2), "cf3": (-HEIGHT, -SIDE / 2)}
START_NS = 1_600_000_000 * NS_PER_S
DELAY_NS = 28_000_000
RATE_HZ = 60
META = {
    "limits_x": [-5.0, 5.0],
    "limits_y": [-5.0, 5.0],
    "base_offset_c": [0.0, 0.0],
    "pos_coef": 1.0,
    "l": SIDE,
    "triangle_height_factor": HEIGHT / SIDE,
    "R_obstacles": 0.27,
    "run": "made",
}

Seen = Callable[[str, float], bool]


def hand_place(t: float) -> tuple[float, float, float]:
    """Where the hand is."""
    return 0.8 * math.sin(0.7 * t), 0.3 * math.sin(1.3 * t), 1.2


def body_place(name: str, t: float) -> tuple[float, float, float]:
    """Where a body is; the drones stay in formation but for a slow breath."""
    x, y, z = hand_place(t)
    if name == "glove":
        return x, y, z
    dx, dy = OFFSETS[name]
    breath = 1.0 + 0.02 * math.sin(2.0 * t)
    return x + breath * dx, y + breath * dy, z


def write_flight(
    folder: Path,
    seconds: float = 10.0,
    is_seen: Seen = lambda *_: True,
    patterns: Iterable[tuple[float, str]] = (),
) -> Path:
    """Records the flight; bodies are in it where they are seen.

    Args:
        folder: Created if missing.
        seconds: Length.
        is_seen: Name of the body (`glove`, `cf1` ...) and time -> whether the tracker sees it.
        patterns: When patterns were felt, s, and their recorded names.
    """
    folder.mkdir(parents=True, exist_ok=True)
    times = [k / RATE_HZ for k in range(round(seconds * RATE_HZ) + 1)]
    for name in ("glove", *OFFSETS):
        rows = [_row(t, body_place(name, t), (0.0, 0.0, 0.0, 1.0)) for t in times if is_seen(name, t)]
        _write(folder / f"{name}.csv.gz", "t_ns,t_bag_ns,x,y,z,qx,qy,qz,qw", rows)
    for name in OFFSETS:
        rows = [_row(t, body_place(name, t)) for t in times[::3]]
        _write(folder / f"{name}_sp.csv.gz", "t_ns,t_bag_ns,x,y,z", rows)
    felt = (f"{START_NS + DELAY_NS + round(t * NS_PER_S)},{name}" for t, name in patterns)
    _write(folder / "pattern_topic.csv.gz", "t_bag_ns,name", felt)
    (folder / "obstacles.csv").write_text("name,median_x,median_y\no0,3.0,3.0\n", encoding="ascii")
    (folder / "meta.json").write_text(json.dumps(META), encoding="ascii")
    return folder


def _row(t: float, *groups: tuple[float, ...]) -> str:
    stamp_ns = START_NS + round(t * NS_PER_S)
    return ",".join([str(stamp_ns), str(stamp_ns + DELAY_NS), *(f"{x:.9f}" for group in groups for x in group)])


def _write(path: Path, header: str, rows: Iterable[str]) -> None:
    with gzip.open(path, "wt", encoding="ascii") as file:
        file.write("\n".join((header, *rows)) + "\n")
