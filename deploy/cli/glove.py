"""`swarmtouch glove`: the tactile patterns, shown, played, compared and drawn."""

import argparse
from pathlib import Path

from shared.errors import ConfigError

DESCRIPTION = """glove patterns       lists the pattern sets
glove patterns SET   shows a set: its frames, and how well people would tell its patterns apart. The latter is
                     the prediction of a fitted model of perception, not a measurement."""
EXAMPLE = """swarmtouch glove patterns distinct --compare paper
         swarmtouch glove patterns flight --play
         swarmtouch glove patterns paper --svg paper.svg"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments."""
    parser.add_argument("action", choices=["patterns"], help="what to look at")
    parser.add_argument("set", nargs="?", metavar="SET", help="name of a set that ships, or a TOML file")
    parser.add_argument("--compare", metavar="SET", help="show the prediction of another set beside")
    parser.add_argument("--play", action="store_true", help="play every pattern on the terminal")
    parser.add_argument("--svg", type=Path, metavar="FILE", help="draw the set as an SVG picture")


def run(arguments: argparse.Namespace) -> int:
    """Shows what was asked for and returns the exit code."""
    from deploy.glove.play import play_set  # noqa: PLC0415  --help must not load numpy and rich
    from deploy.glove.show import list_sets, show_set  # noqa: PLC0415
    from deploy.glove.svg import draw_svg  # noqa: PLC0415
    from glove_bridge.patterns import load_patterns  # noqa: PLC0415

    if arguments.set is None:
        if arguments.compare or arguments.play or arguments.svg:
            raise ConfigError("glove patterns: which set? For example: swarmtouch glove patterns paper --play")
        list_sets()
        return 0
    patterns = load_patterns(arguments.set)
    show_set(patterns, load_patterns(arguments.compare) if arguments.compare else None)
    if arguments.svg:
        _write(arguments.svg, draw_svg(patterns))
    if arguments.play:
        play_set(patterns)
    return 0


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"--svg {path}: cannot be written: {error}") from error
