"""CSV tables of numbers, plain or gzipped, with errors that name the file and the row."""

import csv
import gzip
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shared.errors import ConfigError
from shared.recordings.track import Stamps, Vec

LARGEST = 4e9
"""Size of the largest number: times in s up to it, until 2096, are 64 bits of ns apart at most."""


def read_table(path: Path, *, integers: Sequence[str] = (), numbers: Sequence[str] = ()) -> tuple[Stamps, Vec]:
    """Reads named columns of a CSV file with a header; other columns are ignored.

    Args:
        path: The file; `.gz` is unpacked on the way.
        integers: Columns of nanosecond stamps, whole numbers (they lose digits as floats).
        numbers: Columns of finite numbers.

    Returns:
        `(n, len(integers))` and `(n, len(numbers))`, n >= 1.

    Raises:
        ConfigError: The file or a column is missing, or a row is wrong: path, row and what is expected.
    """
    header, *rows = read_rows(path)
    wanted = (*integers, *numbers)
    missing = [name for name in wanted if name not in header]
    if missing:
        raise ConfigError(
            f"{path}: no column {', '.join(missing)}; expected the header {','.join(wanted)}, "
            f"found {','.join(header)}"
        )
    if not rows:
        raise ConfigError(f"{path}: no rows below the header")
    whole_columns = [header.index(name) for name in integers]
    number_columns = [header.index(name) for name in numbers]
    whole, real = [], []
    for line, row in enumerate(rows, start=2):
        try:
            whole.append([_stamp(row[column]) for column in whole_columns])
            real.append([_number(row[column]) for column in number_columns])
        except (ValueError, IndexError) as error:
            raise ConfigError(
                f"{path}: row {line}: {error}; expected numbers for {','.join(wanted)}"
            ) from error
    return (
        np.array(whole, dtype=np.int64).reshape(len(rows), len(integers)),
        np.array(real, dtype=np.float64).reshape(len(rows), len(numbers)),
    )


def read_rows(path: Path) -> list[list[str]]:
    """Reads every row of a CSV file as text, the header first; empty lines are left out.

    Raises:
        ConfigError: The file is missing, unreadable or empty.
    """
    try:
        with gzip.open(path, "rt", newline="") if path.suffix == ".gz" else path.open(newline="") as file:
            rows = [row for row in csv.reader(file) if row]
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{path.absolute()}: cannot be read as CSV: {error}") from error
    if not rows:
        raise ConfigError(f"{path}: empty; expected a header and rows")
    return rows


def _stamp(text: str) -> int:
    stamp = int(text)
    if not 0 <= stamp < 2**63:
        raise ValueError(f"{text!r} is no time in ns")
    return stamp


def _number(text: str) -> float:
    number = float(text)
    if not abs(number) <= LARGEST:
        raise ValueError(f"{text!r} is not finite or larger than {LARGEST:g}")
    return number
