"""Settings that a container or a service gives in one environment variable."""

_CLOSING = {"[": "]", "{": "}"}
_QUOTES = "\"'"


def split_overrides(text: str) -> list[str]:
    """Splits `key=value` items at white space, but for that within quotes or brackets.

    An item may be quoted as a whole, as in a shell. Quotes within it are TOML's and stay.

    Args:
        text: For example `net.profile=field formation.offsets=[[0, 0], [1, 0]]`.
    """
    items, item = [], ""
    open_ones: list[str] = []
    before = ""
    for character in text:
        if not open_ones and character.isspace():
            items.append(item)
            item = ""
        else:
            _note(open_ones, character, before)
            item += character
        # In a string an escaped backslash escapes nothing more.
        before = "" if before == "\\" and character == "\\" else character
    return [_unquoted(item) for item in (*items, item) if item]


def _note(open_ones: list[str], character: str, before: str) -> None:
    """Follows which quotes and brackets are open, as what would close them."""
    innermost = open_ones[-1] if open_ones else ""
    if innermost and innermost in _QUOTES:
        escaped = innermost == '"' and before == "\\"
        if character == innermost and not escaped:
            open_ones.pop()
    elif character == innermost:
        open_ones.pop()
    elif character in _QUOTES:
        open_ones.append(character)
    elif character in _CLOSING:
        open_ones.append(_CLOSING[character])


def _unquoted(item: str) -> str:
    quote, inside = item[0], item[1:-1]
    quoted = quote in _QUOTES and item.endswith(quote) and "=" in inside and quote not in inside
    return inside if quoted else item
