"""A trace as CSV: one table per key with every message, and one with all of them side by side in time."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from observer.trace.read import Trace
from shared.clock import NS_PER_S
from shared.formation import build_formation
from shared.messages import Heard, Message, Seen
from shared.obstacle_watch import MOST_OBSTACLES
from shared.scenario import Scenario
from shared.spreadsheet import cell
from shared.topics import (
    DRONE_STATE,
    FORMATION_STATE,
    HAND,
    OBSTACLE,
    PATTERN,
    TOPICS,
    parse_key,
    rank,
    topic_of,
)

ALIGNED = "aligned.csv"
"""Name of the table with everything side by side."""

_PERIOD_NS = round(NS_PER_S / HAND.rate_hz)
_SIDE_BY_SIDE = (HAND, DRONE_STATE, OBSTACLE, FORMATION_STATE, PATTERN)
_LONGEST_CURRENT_S = max(topic.stale_s for topic in TOPICS if topic in _SIDE_BY_SIDE)
"""After this long without a message nothing is current."""
_TECHNICAL = (
    *("log_ns", "epoch", "seq", "stamp_ns", "id", "step_ns", "signature", "heard", "missing"),
    *("unheard", "lost"),
)
_OWN_COLUMNS, _COLUMNS_PER_DRONE = 256, 8
"""Columns that a table has at most: what a message says itself, and what it says of each drone (the distance to
it, three numbers of its sample that was heard)."""
_KEPT_ROWS = 4096
"""Rows that wait in memory; a table for every key would be more open files than a process may have."""

Row = dict[str, Any]


class Exported(NamedTuple):
    """What was written.

    Attributes:
        files: The tables.
        left_out: Columns for which there was no room: whoever sends makes up the names of some.
    """

    files: list[Path]
    left_out: int


def export_csv(trace: Trace, folder: Path) -> Exported:
    """Writes the tables.

    `<key with dashes>.csv` has one row per valid message, with the names of its fields; vectors become `_x`,
    `_y`, `_z`, maps `field.key`. `aligned.csv` has 60 rows per second of the recorder's clock: `time_s`
    since the first message, and what was then the newest of hand, drones, obstacles, formation and glove, left
    empty where it is older than its topic allows; there are no rows for times in which all of it is. A pattern
    event stands in the one row in which it came.

    Args:
        trace: What to write; it is read twice, and never held in memory.
        folder: Where; created if missing, tables that exist are replaced.

    Returns:
        What was written.

    Raises:
        OSError: They cannot be written.
    """
    columns, left_out = _columns(trace)
    own = set(build_formation(trace.scenario).ids)
    chosen = {key: _chosen(key, names) for key, names in columns.items() if _is_side_by_side(key, own)}
    folder.mkdir(parents=True, exist_ok=True)
    together = [name for names in chosen.values() for name in names.values()]
    tables = _Tables(folder)
    for key, names in columns.items():
        tables.begin(f"{key.replace('/', '-')}.csv", list(names))
    tables.begin(ALIGNED, ["time_s", *together])
    moments = _Moments(chosen)
    for key, log_ns, row in _rows(trace):
        tables.write(f"{key.replace('/', '-')}.csv", row)
        for moment in moments.until(log_ns):
            tables.write(ALIGNED, moment)
        moments.add(key, log_ns, row)
    return Exported(tables.finish(), left_out)


def flatten(message: Message) -> Row:
    """Returns the fields of a message as cells of a table."""
    cells: Row = {}
    for name in message.__struct_fields__:
        _flatten(name, getattr(message, name), cells)
    return cells


class _Tables:
    """CSV files that grow side by side; none stays open.

    Args:
        folder: Where they are.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._columns: dict[str, list[str]] = {}
        self._waiting: dict[str, list[list[object]]] = {}
        self._count = 0

    def begin(self, name: str, columns: Sequence[str]) -> None:
        """Makes a new file with a header."""
        self._columns[name] = list(columns)
        self._append(name, [[cell(column) for column in columns]], "w")

    def write(self, name: str, row: Row) -> None:
        """Adds a row; a cell that it does not have is empty, and one of no column is left out."""
        self._waiting.setdefault(name, []).append([cell(row.get(column, "")) for column in self._columns[name]])
        self._count += 1
        if self._count >= _KEPT_ROWS:
            self.finish()

    def finish(self) -> list[Path]:
        """Writes what waits; returns the files."""
        for name, rows in self._waiting.items():
            self._append(name, rows, "a")
        self._waiting, self._count = {}, 0
        return [self._folder / name for name in self._columns]

    def _append(self, name: str, rows: list[list[object]], mode: str) -> None:
        with (self._folder / name).open(mode, newline="", encoding="utf-8") as stream:
            csv.writer(stream).writerows(rows)


class _Moments:
    """The newest of everything, sampled at a fixed rate.

    Args:
        chosen: By key, the columns that are wanted and their names in the common table.
    """

    def __init__(self, chosen: dict[str, dict[str, str]]) -> None:
        self._chosen = chosen
        self._newest: dict[str, tuple[int, Row]] = {}
        self._first_ns: int | None = None
        self._count = 0

    def add(self, key: str, log_ns: int, row: Row) -> None:
        """Takes the next row of a key."""
        if self._first_ns is None:
            self._first_ns = log_ns
        if key in self._chosen:
            self._newest[key] = (
                log_ns,
                {name: row.get(column, "") for column, name in self._chosen[key].items()},
            )

    def until(self, log_ns: int) -> Iterator[Row]:
        """Yields the moments before a time that have not been yielded and in which anything was current."""
        while self._first_ns is not None and (now_ns := self._first_ns + self._count * _PERIOD_NS) < log_ns:
            newest_ns = max((seen_ns for seen_ns, _ in self._newest.values()), default=0)
            if now_ns - newest_ns > _LONGEST_CURRENT_S * NS_PER_S:
                self._count += -(-(log_ns - now_ns) // _PERIOD_NS)
                return
            moment = {"time_s": f"{self._count / HAND.rate_hz:.6f}"}
            for key, (seen_ns, cells) in list(self._newest.items()):
                stale_s = topic_of(key).stale_s
                if not stale_s:
                    del self._newest[key]
                if not stale_s or now_ns - seen_ns <= stale_s * NS_PER_S:
                    moment |= cells
            self._count += 1
            yield moment


def _rows(trace: Trace) -> Iterator[tuple[str, int, Row]]:
    for record, message in trace.messages():
        yield record.key, record.log_ns, {"log_ns": record.log_ns, **flatten(message)}


def _columns(trace: Trace) -> tuple[dict[str, dict[str, None]], int]:
    """Returns the columns of every key, in the order of first appearance, and how many are left out.

    The keys are sorted.
    """
    most = most_columns(trace.scenario)
    columns: dict[str, dict[str, None]] = {}
    left_out: set[str] = set()
    for key, _, row in _rows(trace):
        own = columns.setdefault(key, {})
        for name in row:
            if name not in own and len(own) >= most:
                left_out.add(name if len(left_out) < most else "")
            else:
                own[name] = None
    return dict(sorted(columns.items(), key=lambda item: rank(item[0]))), len(left_out)


def most_columns(scenario: Scenario) -> int:
    """Returns how many columns a table of a swarm has at most."""
    return _OWN_COLUMNS + _COLUMNS_PER_DRONE * len(build_formation(scenario).ids)


def _is_side_by_side(key: str, drones: set[int]) -> bool:
    place = parse_key(key)
    if place.topic is DRONE_STATE:
        return place.id in drones
    if place.topic is OBSTACLE:
        return place.id <= MOST_OBSTACLES
    return place.topic in _SIDE_BY_SIDE


def _chosen(key: str, columns: dict[str, None]) -> dict[str, str]:
    """Names the columns of a key that stand in the common table: `drone/1/state` -> `drone_1_...`."""
    prefix = key.removesuffix("/state").replace("/", "_")
    wanted = [column for column in columns if column.partition(".")[0] not in _TECHNICAL]
    return {column: f"{prefix}_{column}" for column in wanted}


def _flatten(name: str, value: Any, cells: Row) -> None:
    if isinstance(value, Heard):
        cells.update({f"{name}.{part}": item for part, item in value._asdict().items()})
    elif isinstance(value, tuple) and len(value) == 3 and all(isinstance(item, float) for item in value):
        cells.update({f"{name}_{axis}": item for axis, item in zip("xyz", value, strict=True)})
    elif isinstance(value, tuple):
        cells[name] = " ".join(str(item.id if isinstance(item, Seen) else item) for item in value)
    elif isinstance(value, dict):
        for key, item in value.items():
            _flatten(f"{name}.{key}", item, cells)
    elif isinstance(value, bytes):
        cells[name] = value.hex()
    else:
        cells[name] = int(value) if isinstance(value, int) else value
