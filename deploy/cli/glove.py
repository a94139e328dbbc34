"""`swarmtouch glove`: tactile patterns to look at, and the tools for a glove on a serial line."""

import argparse
import importlib
from pathlib import Path

from deploy.cli.arguments import new_file, number, seconds, whole

DESCRIPTION = """Looks at tactile patterns, and sets up a glove. A glove is named as for `swarmtouch up`:
serial:///dev/ttyACM0, with ?link=xbee by radio, with ?calibration=FILE as calibrated; without --glove it is
the only USB serial port there is. docs/glove.md goes from the parts to the first vibration."""
EXAMPLE = """swarmtouch glove patterns distinct --compare paper
         swarmtouch glove buzz 3 200 500
         swarmtouch glove play EI --glove serial:///dev/ttyACM0?calibration=mine.toml"""

ACTIONS = {
    "patterns": ("list the pattern sets, or show, play, compare and draw one", "paper --compare distinct"),
    "ports": ("list the serial ports of this machine", ""),
    "hello": ("ask the device what it is, and how fast it answers", "--glove serial:///dev/ttyACM0"),
    "buzz": ("vibrate one finger", "3 200 500"),
    "play": ("play one pattern, or all of a set", "all --patterns flight"),
    "calibrate": ("find out what each motor needs, and write it to a file", "--output mine.toml"),
    "flash": ("put the firmware on an Arduino UNO", "--port /dev/ttyACM0"),
}
"""Action -> one line, and an example; the module `deploy.glove.<action>` does it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the actions, each with its own arguments."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    children = {
        name: actions.add_parser(
            name,
            help=summary,
            description=f"{summary.capitalize()}.",
            epilog=f"example: swarmtouch glove {name} {example}",
        )
        for name, (summary, example) in ACTIONS.items()
    }
    _add_patterns(children["patterns"])
    for name in ("hello", "buzz", "play", "calibrate"):
        children[name].add_argument("--glove", metavar="URI", help="the glove (default: the only USB port)")
    buzz, play, calibrate, flash = (children[name] for name in ("buzz", "play", "calibrate", "flash"))
    buzz.add_argument("finger", type=whole(1, 5), metavar="FINGER", help="1 (thumb) to 5")
    buzz.add_argument("hz", type=number(50.0, 300.0), metavar="HZ", help="frequency, 50 to 300 Hz")
    buzz.add_argument("ms", type=whole(20, 2000), metavar="MS", help="length, 20 to 2000 ms")
    play.add_argument("name", metavar="NAME", help="a pattern, for example EI; `all` for the whole set")
    play.add_argument("--patterns", default="paper", metavar="SET", help="its set (default: %(default)s)")
    calibrate.add_argument(
        "--output", type=new_file, default=Path("glove.toml"), metavar="FILE", help="default: %(default)s"
    )
    calibrate.add_argument(
        "--turn", type=seconds, default=1.0, metavar="S", help="length of a trial, s (default: %(default)s)"
    )
    flash.add_argument("--port", metavar="DEVICE", help="default: the only USB port")
    flash.add_argument("--hex", type=Path, metavar="FILE", help="default: the firmware that ships")


def run(arguments: argparse.Namespace) -> int:
    """Does what was asked for and returns the exit code."""
    # --help must not load numpy, rich and the serial port.
    action = importlib.import_module(f"deploy.glove.{arguments.action}")
    code: int = action.run(arguments)
    return code


def _add_patterns(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("set", nargs="?", metavar="SET", help="name of a set that ships, or a TOML file")
    parser.add_argument("--compare", metavar="SET", help="show the prediction of another set beside")
    parser.add_argument("--play", action="store_true", help="play every pattern on the terminal")
    parser.add_argument("--svg", type=new_file, metavar="FILE", help="draw the set as an SVG picture")
