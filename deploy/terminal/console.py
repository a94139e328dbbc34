"""A console that shows foreign text as it is."""

import sys
from typing import Any, TextIO, cast

from rich.console import Console
from rich.text import Text

from deploy.terminal.streams import PatientStream, SteadyStream
from shared.plain_text import plain

WIDTH = 80
"""Tables fit into so many columns; a narrower terminal folds their lines, but nothing is left out."""
_LONGEST_LINE = 4000


class PlainConsole(Console):
    """A console to which every string is text: not markup, not emoji, and nothing that a terminal acts upon.

    Rich brings each string here that is printed, or stands in a table. Print strings, no `Text` of your own.
    """

    def render_str(self, text: str, **options: Any) -> Text:
        """See the base class."""
        lines = "\n".join(plain(line, _LONGEST_LINE) for line in text.split("\n"))
        return super().render_str(lines, **(options | {"markup": False, "emoji": False, "highlight": False}))


def open_console(stream: PatientStream | None = None, *, stderr: bool = False) -> Console:
    """Opens a console.

    Args:
        stream: Where it prints.
        stderr: Without a stream, whether on standard error instead of standard output.
    """
    target = stream or SteadyStream(sys.stderr if stderr else sys.stdout)
    console = PlainConsole(file=cast(TextIO, target), highlight=False)
    console.width = max(console.width, WIDTH)
    return console
