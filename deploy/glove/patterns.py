"""`swarmtouch glove patterns`: pattern sets listed, shown, compared, drawn and played."""

import argparse

from deploy.glove.player import play_set
from deploy.glove.show import list_sets, show_set
from deploy.glove.svg import draw_svg
from glove_bridge.gloves.terminal import TerminalGlove
from glove_bridge.patterns import load_patterns
from shared.errors import ConfigError
from shared.files import writing


def run(arguments: argparse.Namespace) -> int:
    """Shows what was asked for.

    Raises:
        ConfigError: No set where one is needed, one that is refused, or a picture that cannot be written.
    """
    if arguments.set is None:
        if arguments.compare or arguments.play or arguments.svg:
            raise ConfigError("glove patterns: which set? For example: swarmtouch glove patterns paper --play")
        list_sets()
        return 0
    patterns = load_patterns(arguments.set)
    show_set(patterns, load_patterns(arguments.compare) if arguments.compare else None)
    if arguments.svg:
        with writing(arguments.svg):
            arguments.svg.write_text(draw_svg(patterns), encoding="utf-8")
    if arguments.play:
        play_set(TerminalGlove(), patterns)
    return 0
