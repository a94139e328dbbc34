"""A trace as CSV: one table per key with every message, and one with all of them side by side in time."""

import csv
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from observer.trace.read import Trace
from shared.clock import NS_PER_S
from shared.messages import Heard, Message, Seen
from shared.topics import DRONE_STATE, FORMATION_STATE, HAND, PATTERN, rank, topic_of

ALIGNED = "aligned.csv"
"""Name of the table with everything side by side."""

_PERIOD_NS = round(NS_PER_S / HAND.rate_hz)
_SIDE_BY_SIDE = (HAND, DRONE_STATE, FORMATION_STATE, PATTERN)
_TECHNICAL = (
    *("log_ns", "epoch", "seq", "stamp_ns", "id", "step_ns", "signature", "heard", "missing"),
    *("unheard", "lost"),
)

Row = dict[str, Any]


def export_csv(trace: Trace, folder: Path) -> list[Path]:
    """Writes the tables.

    `<key with dashes>.csv` has one row per valid message, with the names of its fields; vectors become `_x`,
    `_y`, `_z`, maps `field.key`. `aligned.csv` has 60 rows per second of the recorder's clock: `time_s`
    since the first message, and what was then the newest of hand, drones, formation and glove, left empty where
    it is older than its topic allows; a pattern event stands in the one row in which it came.

    Args:
        trace: What to write; it is read twice, and never held in memory.
        folder: Where; created if missing, tables that exist are replaced.

    Returns:
        The files.

    Raises:
        OSError: They cannot be written.
    """
    columns = _columns(trace)
    chosen = {key: _chosen(key, names) for key, names in columns.items() if topic_of(key) in _SIDE_BY_SIDE}
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as files:
        tables = {
            key: _Table(files, folder / f"{key.replace('/', '-')}.csv", list(names))
            for key, names in columns.items()
        }
        together = [name for names in chosen.values() for name in names.values()]
        aligned = _Table(files, folder / ALIGNED, ["time_s", *together])
        moments = _Moments(chosen)
        for key, log_ns, row in _rows(trace):
            tables[key].write(row)
            for moment in moments.until(log_ns):
                aligned.write(moment)
            moments.add(key, log_ns, row)
    return [table.path for table in (*tables.values(), aligned)]


def flatten(message: Message) -> Row:
    """Returns the fields of a message as cells of a table."""
    cells: Row = {}
    for name in message.__struct_fields__:
        _flatten(name, getattr(message, name), cells)
    return cells


class _Table:
    """One CSV file."""

    def __init__(self, files: ExitStack, path: Path, columns: Sequence[str]) -> None:
        self.path = path
        stream = files.enter_context(path.open("w", newline="", encoding="utf-8"))
        self._writer = csv.DictWriter(stream, columns, restval="")
        self._writer.writeheader()

    def write(self, row: Row) -> None:
        self._writer.writerow(row)


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
        """Yields the moments before a time that have not been yielded."""
        while self._first_ns is not None and (now_ns := self._first_ns + self._count * _PERIOD_NS) < log_ns:
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


def _columns(trace: Trace) -> dict[str, dict[str, None]]:
    """Returns the columns of every key, in the order of first appearance; the keys are sorted."""
    columns: dict[str, dict[str, None]] = {}
    for key, _, row in _rows(trace):
        columns.setdefault(key, {}).update(dict.fromkeys(row))
    return dict(sorted(columns.items(), key=lambda item: rank(item[0])))


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
