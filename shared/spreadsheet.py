"""Cells of CSV files that are opened in spreadsheets: numbers stay numbers, and text stays text."""

import math

from shared.plain_text import plain

_FORMULAS = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")
"""What a formula begins with, also in the wide letters of East Asian keyboards."""
_LONGEST = 1 << 15
"""Characters; a spreadsheet takes no more in a cell."""


def cell(value: object) -> object:
    """Returns what to write for a value: what is not a number is empty, and no text becomes a formula.

    Text that begins like a formula gets an apostrophe before it, unless it is a number.
    """
    if isinstance(value, float):
        return value if math.isfinite(value) else ""
    if not isinstance(value, str):
        return value
    begins = value.lstrip(" ").startswith(_FORMULAS)
    text = plain(value, _LONGEST)
    return f"'{text}" if begins and not _is_number(text) else text


def short(value: object) -> object:
    """The same, with nine digits of a number."""
    return f"{value:.9g}" if isinstance(value, float) and math.isfinite(value) else cell(value)


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
