"""Numbers from CSV files, plain or gzipped, within stated bounds; errors name the file and the line."""

import csv
import gzip
import io
import sys
import zlib
from array import array
from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack, closing
from itertools import count
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shared.errors import ConfigError
from shared.files import encoding_of
from shared.recordings.track import NO_STAMP, Stamps, Vec

MOST_LINES = 2_000_000
"""Of one file: nine hours at 60 Hz."""
MOST_CHARACTERS = 1 << 29
"""Of one file, unpacked."""
LONGEST_LINE = 1 << 16
"""Characters."""
LONGEST_TEXT = 200
"""Characters of a cell that is kept as text."""

GZIP = b"\x1f\x8b"

Row = tuple[int, list[str]]
"""The number of its first line, as an editor counts, and its cells."""


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
    most: int = MOST_LINES,
) -> Table:
    """Reads named columns of a CSV file with a header; other columns and empty lines are ignored.

    Blank cells are none of the reader's business: a tracker writes them for what it has lost. A file that
    was cut off ends with its last whole line.

    Args:
        path: The file; it is unpacked if it is gzipped, and its encoding is told by its first bytes.
        integers: Columns of nanosecond stamps, whole numbers (they lose digits as floats).
        numbers: Columns of numbers.
        texts: Columns of text.
        most: Lines at most.

    Raises:
        ConfigError: The file or a column is missing, it is beyond the bounds, or a cell holds something else:
            path, line and what is expected.
    """
    rows = _Rows(path, most)
    with closing(iter(rows)) as content:
        return _table(path, rows, content, integers, numbers, texts)


def read_header(path: Path) -> list[str]:
    """Reads the names of the columns.

    Raises:
        ConfigError: The file is missing, unreadable or empty.
    """
    with closing(iter(_Rows(path, MOST_LINES))) as content:
        _, header = next(content, (0, []))
    _columns(path, header, ())
    return header


def _table(
    path: Path,
    rows: "_Rows",
    content: Iterator[Row],
    integers: Sequence[str],
    numbers: Sequence[str],
    texts: Sequence[str],
) -> Table:
    _, header = next(content, (0, []))
    columns = _columns(path, header, (*integers, *numbers, *texts))
    stamps, reals, lines = array("q"), array("d"), array("q")
    names: list[list[str]] = []
    for line, row in content:
        try:
            cells = [row[column] for column in columns]
        except IndexError as error:
            if not next(content, None):
                rows.remarks.append(f"the last line, {line}, is cut off")
                break
            raise ConfigError(f"{path}: line {line}: {len(row)} cells, but {len(header)} columns") from error
        try:
            stamps.extend(map(_stamp, cells[: len(integers)]))
            reals.extend(map(_number, cells[len(integers) : len(integers) + len(numbers)]))
        except ValueError as error:
            wanted = ",".join((*integers, *numbers))
            raise ConfigError(f"{path}: line {line}: {error}; expected numbers for {wanted}") from error
        if texts:
            names.append([sys.intern(cell[:LONGEST_TEXT]) for cell in cells[-len(texts) :]])
        lines.append(line)
    if not lines:
        raise ConfigError(f"{path}: no rows below the header")
    return Table(
        np.array(stamps, dtype=np.int64).reshape(len(lines), len(integers)),
        np.array(reals, dtype=np.float64).reshape(len(lines), len(numbers)),
        names,
        np.array(lines, dtype=np.int64),
        tuple(rows.remarks),
    )


class _Rows:
    """The rows of a file that are not empty, as text, read as they are asked for.

    Attributes:
        remarks: What is not there, in words, as far as has been read.
    """

    def __init__(self, path: Path, most: int) -> None:
        self.remarks: list[str] = []
        self._path = path
        self._most = most

    def __iter__(self) -> Generator[Row]:
        end = 0
        try:
            with ExitStack() as files:
                reader = csv.reader(self._lines(_open(files, self._path)))
                for cells in reader:
                    begin, end = end + 1, reader.line_num
                    if any(cells):
                        yield begin, [cell.strip() for cell in cells]
        except EOFError:
            self.remarks.append(f"the file is cut off after line {end}")
        except (OSError, zlib.error, UnicodeError, csv.Error) as error:
            raise ConfigError(
                f"{self._path.absolute()}: cannot be read as CSV after line {end}: {error}"
            ) from error

    def _lines(self, stream: io.TextIOWrapper) -> Iterator[str]:
        characters = 0
        for number in count(1):
            line = stream.readline(LONGEST_LINE + 1)
            if not line:
                return
            characters += len(line)
            if len(line) > LONGEST_LINE:
                raise ConfigError(f"{self._path}: line {number}: longer than {LONGEST_LINE} characters")
            if number > self._most or characters > MOST_CHARACTERS:
                raise ConfigError(
                    f"{self._path}: line {number}: too long a file; at most {self._most} lines"
                    f" and {MOST_CHARACTERS >> 20} MiB of text are read"
                )
            yield line


def _open(files: ExitStack, path: Path) -> io.TextIOWrapper:
    stream = files.enter_context(path.open("rb"))
    if stream.peek(2).startswith(GZIP):
        stream = io.BufferedReader(files.enter_context(gzip.GzipFile(fileobj=stream)))
    text = io.TextIOWrapper(stream, encoding=encoding_of(stream.peek(4)), newline="")
    return files.enter_context(text)


def _columns(path: Path, header: list[str], wanted: Sequence[str]) -> list[int]:
    if not header:
        raise ConfigError(f"{path}: empty; expected a header and rows")
    missing = [name for name in wanted if name not in header]
    if missing:
        raise ConfigError(
            f"{path}: no column {', '.join(missing)}; expected the header {','.join(wanted)}, "
            f"found {','.join(header)[:LONGEST_TEXT]}"
        )
    return [header.index(name) for name in wanted]


def _stamp(text: str) -> int:
    if not text:
        return NO_STAMP
    stamp = int(text)
    if not 0 <= stamp < 2**63:
        raise ValueError(f"{text!r} is no time in ns")
    return stamp


def _number(text: str) -> float:
    return float(text) if text else np.nan
