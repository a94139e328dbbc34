"""What a measurement leaves: JSON, tables for people and for `docs/performance.md`, and a picture."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from attrs import frozen
from rich import box
from rich.console import Console
from rich.table import Table

from shared.errors import ConfigError

Json = dict[str, Any]

INK = "#808080"
"""Text and axes of a picture: enough contrast on white and on near-black."""


@frozen(kw_only=True)
class Sheet:
    """One small table.

    Attributes:
        title: What it shows, with units.
        columns: Headings; the first column is words, the others are numbers.
        rows: Cells.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@frozen(kw_only=True)
class Report:
    """The result of one `swarmtouch bench` command.

    Attributes:
        name: `chain`, `step`, `scale`, `lockstep`, `record` or `start`.
        records: One JSON object per line of output.
        sheets: The same for people.
        draw: Draws it into the axes of a `matplotlib` figure.
    """

    name: str
    records: tuple[Json, ...]
    sheets: tuple[Sheet, ...]
    draw: Callable[[Any], None]


def print_report(report: Report, conditions: str, console: Console) -> None:
    """Prints the tables and what they depend on."""
    for sheet in report.sheets:
        table = Table(title=sheet.title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1))
        for index, column in enumerate(sheet.columns):
            table.add_column(column, justify="right" if index else "left")
        for row in sheet.rows:
            table.add_row(*row)
        console.print(table)
    console.print(conditions, soft_wrap=True)


def write_block(report: Report, conditions: str, file: Path) -> None:
    """Replaces what lies between `<!-- bench NAME -->` and `<!-- end NAME -->` in a Markdown file.

    Raises:
        ConfigError: The file has no such block.
    """
    before, begin, _, end, after = split_at_block(report.name, file)
    content = [begin, *(markdown(sheet) for sheet in report.sheets), f"{conditions}.", end]
    file.write_text(before + "\n\n".join(content) + after, encoding="utf-8")


def split_at_block(name: str, file: Path) -> list[str]:
    """Returns the text before a block, its first line, its content, its last line and the text after it.

    Raises:
        ConfigError: The file cannot be read or has no such block.
    """
    begin, end = f"<!-- bench {name} -->", f"<!-- end {name} -->"
    try:
        parts = re.split(
            f"({re.escape(begin)})(.*?)({re.escape(end)})", file.read_text(encoding="utf-8"), flags=re.S
        )
    except OSError as error:
        raise ConfigError(f"--update {file}: {error.strerror}") from error
    if len(parts) != 5:
        raise ConfigError(f"--update {file}: put the lines {begin} and {end} once where the table belongs")
    return parts


def markdown(sheet: Sheet) -> str:
    """Writes a table in Markdown, its title as a paragraph above."""
    alignment = ["---", *("---:" for _ in sheet.columns[1:])]
    lines = (sheet.columns, tuple(alignment), *sheet.rows)
    return f"{sheet.title}:\n\n" + "\n".join(f"| {' | '.join(line)} |" for line in lines)
