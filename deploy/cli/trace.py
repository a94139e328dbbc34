"""`swarmtouch trace`: record, look at, export and replay what a swarm says."""

import argparse
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from deploy.cli.arguments import count, new_file, new_folder, number, seconds, whole

DESCRIPTION = """A trace is every message of a flight, byte by byte as it was sent, in MCAP files in the run
directory. Record one with swarmtouch up --record, or join a flight with swarmtouch trace record.
See docs/trace.md."""
EXAMPLE = """swarmtouch trace info runs/latest
         swarmtouch trace echo "drone/*/state"
         swarmtouch trace export runs/latest --foxglove flight.mcap
         swarmtouch trace path 412 runs/latest --svg path.svg
         swarmtouch trace report runs/latest -o report"""

Declare = Callable[[argparse.ArgumentParser], object]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares what can be done, each with its own arguments."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name, action in _ACTIONS.items():
        child = actions.add_parser(
            name,
            help=action.summary,
            description=action.summary,
            epilog=f"example: swarmtouch trace {name} {action.example}",
        )
        for declare in action.arguments:
            declare(child)


def run(arguments: argparse.Namespace) -> int:
    """Does it and returns the exit code."""
    module = importlib.import_module(f"deploy.trace.{arguments.action}")  # --help must not load the bus
    options = {name: value for name, value in vars(arguments).items() if name not in ("command", "action")}
    code: int = module.main(**options)
    return code


def _argument(*names: str, **options: Any) -> Declare:
    return lambda parser: parser.add_argument(*names, **options)


_RUN = _argument("run", type=Path, metavar="RUN", help="run directory or MCAP file")
_SOURCE_HELP = "run directory, scenario file or name of the running swarm (default: the newest flight)"


class Action(NamedTuple):
    """One thing to do with a trace, by `main` of its module in `deploy.trace`.

    Attributes:
        summary: What it does.
        example: Its arguments in an example.
        arguments: Each declares one argument; they become the keyword arguments of `main`.
    """

    summary: str
    example: str
    arguments: tuple[Declare, ...]


_ACTIONS = {
    "record": Action(
        "join a flight and record it until Ctrl-C",
        "-o runs/mine",
        (
            _argument("source", nargs="?", metavar="SWARM", help=_SOURCE_HELP),
            _argument(
                "-o",
                dest="output",
                type=new_folder,
                metavar="RUN",
                help="run directory (default: the flight's)",
            ),
        ),
    ),
    "info": Action(
        "one row per link: rate, jitter, loss, age, what was rejected",
        "--live",
        (
            _argument(
                "run", nargs="?", metavar="RUN", help="trace, or with --live the swarm (default: the newest)"
            ),
            _argument("--live", action="store_true", help="listen to the running swarm instead"),
            _argument("--links", action="store_true", help="also what the drones and the bridge hear"),
            _argument(
                "--seconds", type=seconds, metavar="S", help="listen for S seconds (default: until Ctrl-C)"
            ),
            _argument("--json", dest="as_json", action="store_true", help="one line of JSON per link"),
        ),
    ),
    "echo": Action(
        "print what is said on a key, one line of JSON per message",
        "drone/2/state",
        (
            _argument("key", metavar="KEY", help="a key; * stands for one part of it, as in drone/*/state"),
            _argument("source", nargs="?", metavar="SWARM", help=_SOURCE_HELP),
            _argument("--count", type=count, metavar="N", help="end after N messages (default: at Ctrl-C)"),
        ),
    ),
    "replay": Action(
        "say again what was recorded, byte by byte and at its pace",
        "runs/latest --speed 2 --keys human/hand",
        (
            _RUN,
            _argument(
                "--speed",
                type=number(0.001, 1000.0),
                default=1.0,
                metavar="X",
                help="2 is twice as fast (default: 1)",
            ),
            _argument(
                "--keys", nargs="+", default=(), metavar="K", help="only these keys; * is one part of a key"
            ),
            _argument(
                "--as-live",
                action="store_true",
                help="under the keys of the flight itself instead of replay/...",
            ),
            _argument(
                "--delay",
                type=seconds,
                default=2.0,
                metavar="S",
                help="time for listeners to connect (default: 2)",
            ),
        ),
    ),
    "export": Action(
        "for Foxglove, Lichtblick and PlotJuggler, or as tables",
        "runs/latest --foxglove flight.mcap --csv tables",
        (
            _RUN,
            _argument("--foxglove", type=new_file, metavar="F", help="an MCAP file with Foxglove's schemas"),
            _argument("--csv", type=new_folder, metavar="DIR", help="CSV tables: aligned.csv and one per key"),
        ),
    ),
    "path": Action(
        "follow one hand sample through the swarm: waiting, transport and compute of every hop",
        "412 runs/latest --svg path.svg",
        (
            _argument("number", type=whole(0, 2**64 - 1), metavar="SEQ", help="number of the hand sample"),
            _RUN,
            _argument("--perfetto", type=new_file, metavar="F", help="write JSON for ui.perfetto.dev"),
            _argument("--svg", type=new_file, metavar="F", help="write a space-time diagram"),
        ),
    ),
    "report": Action(
        "the paper's figures and tables of a flight, as one page and as files",
        "runs/latest -o report",
        (
            _argument(
                "runs",
                nargs="+",
                type=Path,
                metavar="RUN",
                help="run directory or MCAP file, flight folder, or ROS bag; of several, the figures show"
                " the first, the tables all",
            ),
            _argument("-o", dest="output", type=new_folder, metavar="DIR", required=True, help="where to"),
        ),
    ),
}
