"""Rows of CSV files, plain or gzipped, in any encoding, and no more of them than a stated number.

Cells are separated by commas, semicolons or tabs: whatever separates the most in the first line, or what a
line `sep=;` before it says, as spreadsheets write it. Lines that begin with `#` are comments; right before
numbers one is the header, as NumPy writes it.
"""

import csv
import gzip
import io
import re
import zlib
from collections.abc import Generator, Iterator
from contextlib import ExitStack
from itertools import chain, count
from pathlib import Path

from shared.errors import ConfigError
from shared.files import encoding_of

MOST_LINES = 2_000_000
"""Of one file: nine hours at 60 Hz."""
MOST_CHARACTERS = 1 << 29
"""Of one file, unpacked."""
LONGEST_LINE = 1 << 16
"""Characters."""

_SEPARATORS = ",;\t"
_SAID = "sep="
_COMMENT = "#"
_NUMBERS = re.compile(r"[\d\s.,;+\-eE\"]+")

_GZIP = b"\x1f\x8b"

Row = tuple[int, list[str]]
"""The number of its first line, as an editor counts, and its cells."""


class CsvRows:
    """The rows of a file that are not empty, as text, read as they are asked for.

    Args:
        path: The file.
        most: Lines at most.

    Attributes:
        separator: What stands between cells, from the first row on.
        remarks: What is not there, in words, as far as has been read.
    """

    def __init__(self, path: Path, most: int) -> None:
        self.separator = ","
        self.remarks: list[str] = []
        self._path = path
        self._most = most

    def __iter__(self) -> Generator[Row]:
        end = 0
        try:
            with ExitStack() as files:
                lines = self._lines(_open(files, self._path))
                head, names = _head(lines)
                self.separator, is_said = _separator(names)
                reader = csv.reader(chain(head, map(_uncommented, lines)), delimiter=self.separator)
                for cells in reader:
                    begin, end = end + 1, reader.line_num
                    if any(cells) and not (is_said and end == len(head)):
                        yield begin, [cell.strip() for cell in cells]
        except EOFError:
            self.remarks.append(f"the file is cut off after line {end}")
        except UnicodeError as error:
            raise ConfigError(
                f"{self._path}: no text in UTF-8 or UTF-16, from about line {end + 1} on ({error}); a hand is a"
                " table of text, saved as UTF-8"
            ) from error
        except (OSError, zlib.error, csv.Error) as error:
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


def _head(lines: Iterator[str]) -> tuple[list[str], str]:
    """Reads to the first line that is neither blank nor a comment.

    Returns:
        As many lines as were read, comments blanked, and that one of them that is to name the columns.
    """
    head, comment = list[str](), -1
    for line in lines:
        head.append(line)
        if line.startswith(_COMMENT):
            comment = len(head) - 1
        elif line.strip():
            break
    if not head:
        return [], ""
    named = head[comment].removeprefix(_COMMENT) if comment >= 0 and _NUMBERS.fullmatch(head[-1]) else ""
    head = [_uncommented(line) for line in head]
    if named:
        head[comment] = named
    return head, named or head[-1]


def _uncommented(line: str) -> str:
    """Blanks a comment: lines keep their numbers."""
    return "\n" if line.startswith(_COMMENT) else line


def _separator(line: str) -> tuple[str, bool]:
    """Tells by the first line what separates cells, and whether it is a line that says just that."""
    said = line.strip(" \r\n").strip('"')
    if said.lower().startswith(_SAID) and len(said) == len(_SAID) + 1 and said[-1] in _SEPARATORS:
        return said[-1], True
    return max(_SEPARATORS, key=line.count), False


def _open(files: ExitStack, path: Path) -> io.TextIOWrapper:
    stream = files.enter_context(path.open("rb"))
    if stream.peek(2).startswith(_GZIP):
        stream = io.BufferedReader(files.enter_context(gzip.GzipFile(fileobj=stream)))
    text = io.TextIOWrapper(stream, encoding=encoding_of(stream.peek(4)), newline="")
    return files.enter_context(text)
