"""One line of the table: a fault, what it did, and whether that was as designed."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

from attrs import frozen
from rich import box
from rich.console import Console
from rich.table import Table

from tests.chaos.watch import Watch

LEAST_DISTANCE = 0.20
"""Between any two bodies of which one is in the air, m."""

COLUMNS = (
    "fault",
    "cue_ms",
    "alarm_ms",
    "behaviour",
    "recovered_s",
    "min_distance_m",
    "fence_exits",
    "unused",
    "ok",
)


@frozen(kw_only=True)
class Row:
    """What one fault did.

    Attributes:
        fault: What was done.
        cue_ms: From the fault to the loss of a liveliness token, None without one.
        alarm_ms: From the fault to the first new flag of a healthy drone, None without one.
        behaviour: Modes and flags of the healthy drones.
        recovered_s: From the end of the fault (or, if it never ends, from its begin) to normal; None: never.
        min_distance_m: Smallest distance of two bodies in the flight, by the referee.
        fence_exits: By the referee.
        unused: Fraction of the samples of its inputs that a healthy drone never used.
        notes: Further measurements of this fault.
        failures: What was not as designed.
        late: What was, but later than designed: a fault, or a machine that was busy with something else.
    """

    fault: str
    cue_ms: float | None
    alarm_ms: float | None
    behaviour: str
    recovered_s: float | None
    min_distance_m: float
    fence_exits: int
    unused: float
    notes: tuple[str, ...]
    failures: tuple[str, ...]
    late: tuple[str, ...]


def judge(
    fault: str,
    watch: Watch,
    *,
    gone: str | None = None,
    recovered_s: float | None,
    demands: Iterable[tuple[bool, str]] = (),
    times: Iterable[tuple[float | None, float, str]] = (),
    notes: Sequence[str] = (),
) -> Row:
    """Puts together what a watch has seen.

    Args:
        fault: What was done.
        watch: What was seen.
        gone: Token of the process that died, None if none did.
        recovered_s: See `Row`.
        demands: What the design says of this fault: whether it held, and what was demanded. That it recovered,
            that bodies kept their distance and that nobody left the fence is demanded always.
        times: What the design says of its times: how long it took, how long it may take, s, and what.
        notes: Further measurements.
    """
    referee = watch.referee()
    distance, exits = referee["min_distance_m"], int(referee["fence_exits"])
    lost, total = watch.unused()
    cue = watch.cue(gone) if gone else None
    alarm = watch.alarm()
    always = [
        (recovered_s is not None, "normal again"),
        (distance >= LEAST_DISTANCE, f"bodies {LEAST_DISTANCE} m apart"),
        (exits == 0, "nobody outside the fence"),
    ]
    return Row(
        fault=fault,
        cue_ms=None if cue is None else 1e3 * cue,
        alarm_ms=None if alarm is None else 1e3 * alarm,
        behaviour=watch.behaviour(),
        recovered_s=recovered_s,
        min_distance_m=distance,
        fence_exits=exits,
        unused=lost / max(total, 1),
        notes=tuple(notes),
        failures=tuple(text for held, text in (*always, *demands) if not held),
        late=tuple(text for took, limit, text in times if took is None or took > limit),
    )


def write_csv(rows: Iterable[Row], path: Path) -> None:
    """Writes the table as CSV."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow((*COLUMNS, "notes", "failures", "late"))
        writer.writerows((*_cells(row), *map("; ".join, (row.notes, row.failures, row.late))) for row in rows)


def print_table(rows: Iterable[Row], console: Console) -> None:
    """Prints the table, with what failed below."""
    table = Table(*COLUMNS, box=box.SIMPLE_HEAD)
    rows = tuple(rows)
    for row in rows:
        table.add_row(*_cells(row))
    console.print(table)
    for row in rows:
        for failure in row.failures:
            console.print(f"{row.fault}: demanded: {failure}")
        for late in row.late:
            console.print(f"{row.fault}: late: {late}")
        for note in row.notes:
            console.print(f"{row.fault}: {note}")


def _cells(row: Row) -> tuple[str, ...]:
    return (
        row.fault,
        _number(row.cue_ms, 0),
        _number(row.alarm_ms, 0),
        row.behaviour,
        _number(row.recovered_s, 2),
        _number(row.min_distance_m, 3),
        str(row.fence_exits),
        f"{row.unused:.2%}",
        "no" if row.failures else "late" if row.late else "yes",
    )


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
