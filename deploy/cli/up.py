"""`swarmtouch up`: a flight with real processes on this machine."""

import argparse
from pathlib import Path

from deploy.cli.arguments import add_flight_arguments, seconds

DESCRIPTION = """Starts the world, one agent per drone and the hand relay as processes of their own, flies the
scenario, lands, ends every process and prints a summary. Each run leaves runs/<stamp>/ with the resolved
scenario, one log per process and summary.json; runs/latest points at the newest.

While it flies: Ctrl-C lands and ends (from up to 1.2 m within 6 s), again: within 1 s; the space bar stops all
motors; Ctrl-Z lands before it stops, and fg flies on. A terminal that is closed is a Ctrl-C, but with nohup.
Exit code 0: every drone followed if the hand asked for it, everybody landed, no process ended unexpectedly,
no collision, no fence exit; else 1, and the summary says why."""
EXAMPLE = """swarmtouch up rhombus --seconds 30
         swarmtouch up slalom --console --hand pointer://
         swarmtouch up maze --hand recording:flights/S2_visual_1
         swarmtouch up maze --hand recording:flights/S2_visual_1 --glove terminal:// --patterns flight
         swarmtouch up line --set formation.n=8 --json"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments."""
    add_flight_arguments(parser, hand="scripted:tour")
    parser.add_argument(
        "--console", action="store_true", help="serve a page that shows the swarm and may take its hand"
    )
    parser.add_argument(
        "--glove",
        metavar="URI",
        help="make the swarm felt: serial://DEVICE, terminal:// or record://FILE (default: no glove; with"
        " --console its page)",
    )
    parser.add_argument(
        "--patterns",
        metavar="SET",
        default="paper",
        help="pattern set of the glove: see swarmtouch glove patterns (default: %(default)s)",
    )
    parser.add_argument(
        "--seconds", type=seconds, metavar="S", help="land after S seconds (default: when the hand ends)"
    )
    parser.add_argument(
        "--runs",
        type=Path,
        default=Path("runs"),
        metavar="DIR",
        help="where runs are kept (default: %(default)s)",
    )
    parser.add_argument(
        "--json",
        action="store_true",
        help="last line of stdout is the summary as JSON; the rest goes to stderr",
    )
    parser.add_argument("--no-live", action="store_true", help="plain lines instead of a live table")
    parser.add_argument("--record", action="store_true", help="record every message: see swarmtouch trace")
    parser.add_argument("-v", "--verbose", action="store_true", help="the processes log debugging details")


def run(arguments: argparse.Namespace) -> int:
    """Flies and returns the exit code."""
    from deploy.launcher.launch import Options, launch  # noqa: PLC0415  --help must not load the bus
    from deploy.launcher.process_table import GloveChoice  # noqa: PLC0415

    glove = arguments.glove or ("screen://" if arguments.console else None)
    worn = GloveChoice(uri=glove, patterns=arguments.patterns) if glove else None
    summary = launch(
        Options(
            scenario=arguments.scenario,
            hand=arguments.hand,
            glove=worn,
            console=arguments.console,
            seconds=arguments.seconds,
            overrides=tuple(arguments.overrides),
            runs=arguments.runs,
            json=arguments.json,
            live=not arguments.no_live,
            record=arguments.record,
            verbose=arguments.verbose,
        )
    )
    return 0 if summary["ok"] else 1
