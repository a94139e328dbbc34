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
    cut = f"{said[:longest]}..." if len(said) > longest else said
    if cut.isprintable():
        return cut
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in cut)
