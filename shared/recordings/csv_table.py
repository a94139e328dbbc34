"""Columns of CSV files, as numbers and as text; errors name the file and the line."""

import sys
from array import array
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shared.errors import ConfigError
from shared.recordings.csv_rows import MOST_LINES, CsvRows
from shared.recordings.track import NO_STAMP, Stamps, Vec

_LONGEST_STAMP = 19
"""Digits of the largest 64 bit integer."""
_LONGEST_SHOWN = 40
"""Characters of a wrong cell that are shown."""
_BRACKETS = (("[", "]"), ("(", ")"))
_NO_UNITS: Mapping[str, str] = {}
LONGEST_TEXT = 200
"""Characters of a cell that is kept as text."""


class Table(NamedTuple):
    """The wanted columns of a CSV file.

    Attributes:
        stamps: (n, integers) ns; `NO_STAMP` where the cell is blank.
        numbers: (n, numbers); not a number where the cell is blank.
        texts: (n, texts); empty if none are wanted.
        lines: (n,) the line of each row in the file.
        remarks: What is not there, in words.
    """

    stamps: Stamps
    numbers: Vec
    texts: list[list[str]]
    lines: Stamps
    remarks: tuple[str, ...]


def read_table(
    path: Path,
    *,
    integers: Sequence[str] = (),
    numbers: Sequence[str] = (),
    texts: Sequence[str] = (),
    units: Mapping[str, str] = _NO_UNITS,
    most: int = MOST_LINES,
) -> Table:
    """Reads named columns of a CSV file with a header; other columns and empty lines are ignored.

    A column may be named in capitals, and with its unit: `X [m]` is `x`.

    Blank cells are none of the reader's business: a tracker writes them for what it has lost. A file that
    was cut off ends with its last whole line.

    Args:
        path: The file; it is unpacked if it is gzipped, and its encoding is told by its first bytes.
        integers: Columns of nanosecond stamps, whole numbers (they lose digits as floats).
        numbers: Columns of numbers.
        texts: Columns of text.
        units: Of columns, in case the header says a unit: another one is refused.
        most: Lines at most.

    Raises:
        ConfigError: The file or a column is missing, it is beyond the bounds, or a cell holds something else:
            path, line and what is expected.
    """
    rows = CsvRows(path, most)
    with closing(iter(rows)) as content:
        _, header = next(content, (0, []))
        for name, unit in units.items():
            _check_unit(path, header, name, unit)
        columns = _Columns(path, header, integers, numbers, texts)
        columns.has_decimal_commas = rows.separator != ","
        for line, cells in content:
            if not columns.add(line, cells):
                if next(content, None):
                    raise ConfigError(f"{path}: line {line}: {len(cells)} cells, but {len(header)} columns")
                rows.remarks.append(f"the last line, {line}, is cut off")
    return columns.table(tuple(rows.remarks))


def read_header(path: Path) -> list[str]:
    """Reads the names of the columns, in small letters and without units.

    Raises:
        ConfigError: The file is missing, unreadable or empty.
    """
    with closing(iter(CsvRows(path, MOST_LINES))) as content:
        _, header = next(content, (0, []))
    _places(path, header, ())
    return [_parted(cell)[0] for cell in header]


class _Columns:
    """Collects the wanted columns, row by row, in little memory."""

    def __init__(
        self,
        path: Path,
        header: list[str],
        integers: Sequence[str],
        numbers: Sequence[str],
        texts: Sequence[str],
    ) -> None:
        self._path = path
        self._integers, self._numbers, self._texts = (
            _places(path, header, names) for names in (integers, numbers, texts)
        )
        self._wanted = ",".join((*integers, *numbers))
        self._last = max((*self._integers, *self._numbers, *self._texts), default=0)
        self._stamps, self._reals, self._lines = array("q"), array("d"), array("q")
        self._names: list[list[str]] = []
        self.has_decimal_commas = False

    def add(self, line: int, cells: list[str]) -> bool:
        """Takes a row; says whether it has all of the columns."""
        if len(cells) <= self._last:
            return False
        try:
            self._stamps.extend([_stamp(cells[place]) for place in self._integers])
            texts = [cells[place] for place in self._numbers]
            if self.has_decimal_commas:
                texts = [text.replace(",", ".") for text in texts]
            self._reals.extend(map(_number, texts))
        except ValueError as error:
            raise ConfigError(
                f"{self._path}: line {line}: {error}; expected numbers for {self._wanted}"
            ) from error
        if self._texts:
            self._names.append([sys.intern(cells[place][:LONGEST_TEXT]) for place in self._texts])
        self._lines.append(line)
        return True

    def table(self, remarks: tuple[str, ...]) -> Table:
        """Returns what was collected."""
        count = len(self._lines)
        if not count:
            raise ConfigError("; ".join((f"{self._path}: no rows below the header", *remarks)))
        return Table(
            np.array(self._stamps, dtype=np.int64).reshape(count, len(self._integers)),
            np.array(self._reals, dtype=np.float64).reshape(count, len(self._numbers)),
            self._names,
            np.array(self._lines, dtype=np.int64),
            remarks,
        )


def _places(path: Path, header: list[str], wanted: Sequence[str]) -> list[int]:
    if not header:
        raise ConfigError(f"{path}: empty; expected a header and rows")
    found = {name: _columns_of(name, header) for name in wanted}
    if missing := [name for name, places in found.items() if not places]:
        raise ConfigError(
            f"{path}: no column {', '.join(missing)}; expected the header {','.join(wanted)}, "
            f"found {','.join(header)[:LONGEST_TEXT]}"
        )
    if twice := [name for name, places in found.items() if len(places) > 1]:
        raise ConfigError(f"{path}: more than one column {', '.join(twice)}; rename the others")
    return [places[0] for places in found.values()]


def _columns_of(name: str, header: list[str]) -> list[int]:
    """Returns where a column of this very name is, or else of one like it."""
    same = [place for place, cell in enumerate(header) if cell == name]
    return same or [place for place, cell in enumerate(header) if _parted(cell)[0] == name]


def _check_unit(path: Path, header: list[str], name: str, unit: str) -> None:
    for place in _columns_of(name, header):
        said = _parted(header[place])[1]
        if said not in ("", unit):
            raise ConfigError(f"{path}: column {header[place][:_LONGEST_SHOWN]}: write {name} in {unit}")


def _parted(cell: str) -> tuple[str, str]:
    """Takes the name of a column, in small letters, and its unit, in brackets behind it or empty, apart."""
    text = cell.lower()
    for left, right in _BRACKETS:
        name, begun, unit = text.removesuffix(right).partition(left)
        if begun and text.endswith(right):
            return name.strip(), unit.strip()
    return text, ""


def _stamp(text: str) -> int:
    if not text:
        return NO_STAMP
    stamp = int(text) if text.isascii() and text.isdecimal() and len(text) <= _LONGEST_STAMP else 2**63
    if stamp >= 2**63:
        raise ValueError(f"{text[:_LONGEST_SHOWN]!r} is no time in ns")
    return stamp


def _number(text: str) -> float:
    if not text:
        return np.nan
    try:
        # Python groups digits by underscores; nobody else does.
        return float("" if "_" in text else text)
    except ValueError:
        raise ValueError(f"{text[:_LONGEST_SHOWN]!r} is no number") from None
