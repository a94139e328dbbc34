"""Colours that colour-blind readers tell apart too (Okabe and Ito)."""

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
HAND = "#222222"


def drone_colour(index: int) -> str:
    """Returns the colour of the n-th drone, from 0; they repeat after six."""
    return COLOURS[index % len(COLOURS)]
