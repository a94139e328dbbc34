"""Foreign text as it may be put before people: in a terminal, a log or a page."""

LONGEST = 200
"""Characters that are shown of one piece; nobody's name is longer."""


def plain(text: object, longest: int = LONGEST) -> str:
    """Returns a text on one line, without anything that acts instead of being seen.

    Control characters, among them those of a terminal, line breaks, marks that turn the direction of writing,
    invisible ones and halves of characters are written as escapes, and what is too long is cut.

    Args:
        text: Whatever somebody else has said.
        longest: How much is shown, characters.
    """
    said = str(text)
    if len(said) <= longest and said.isprintable():
        return said
    room, shown = longest, list[str]()
    for one in said[: longest + 1]:
        piece = one if one.isprintable() else one.encode("unicode_escape").decode()
        room -= len(piece)
        if room < 0:
            return f"{''.join(shown)}..."
        shown.append(piece)
    return "".join(shown)
