"""Rows of CSV files, plain or gzipped, in any encoding, and no more of them than a stated number."""

import csv
import gzip
import io
import zlib
from collections.abc import Generator, Iterator
from contextlib import ExitStack
from itertools import count
from pathlib import Path

from shared.errors import ConfigError
from shared.files import encoding_of

MOST_LINES = 2_000_000
"""Of one file: nine hours at 60 Hz."""
MOST_CHARACTERS = 1 << 29
"""Of one file, unpacked."""
LONGEST_LINE = 1 << 16
"""Characters."""

_GZIP = b"\x1f\x8b"

Row = tuple[int, list[str]]
"""The number of its first line, as an editor counts, and its cells."""


class CsvRows:
    """The rows of a file that are not empty, as text, read as they are asked for.

    Args:
        path: The file.
        most: Lines at most.

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
    if stream.peek(2).startswith(_GZIP):
        stream = io.BufferedReader(files.enter_context(gzip.GzipFile(fileobj=stream)))
    text = io.TextIOWrapper(stream, encoding=encoding_of(stream.peek(4)), newline="")
    return files.enter_context(text)
