"""The command line: `swarmtouch COMMAND`; one module per command, its heavy imports wait until it runs."""

import argparse
import importlib
import sys
from collections.abc import Sequence
from importlib.metadata import version
from typing import Protocol, cast

from deploy.cli.boundary import contain
from shared.compiled import form

PROGRAM = "swarmtouch"

COMMANDS = {
    "up": "fly a scenario with real processes on this machine",
    "console": "see a running flight in the browser, and be its hand",
    "status": "say how a running flight is, by exit code, too",
    "doctor": "look whether this machine can fly, and say what to do if not",
    "glove": "show, play and compare tactile patterns",
    "trace": "record, inspect, export and replay what a swarm says",
    "bench": "measure speed and cost against the floor of the transport",
    "sim": "fly a scenario on a virtual clock in one process",
    "falsify": "look for the flight in which a scenario comes nearest to a collision",
    "vehicle": "measure what a vehicle can do",
    "net": "keys of a swarm and the network configuration of its nodes",
    "scenarios": "list the scenarios that ship",
}
"""Command -> one line; the module has the command's name."""


class Command(Protocol):
    """What the module of a command offers; heavy imports happen in `run`."""

    DESCRIPTION: str
    EXAMPLE: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declares the arguments."""

    def run(self, arguments: argparse.Namespace) -> int:
        """Does it and returns the exit code."""


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command.

    Args:
        argv: Arguments without the program's name, `sys.argv[1:]` by default.

    Returns:
        The exit code: 0 all went well, 1 it did not, 2 refused before anything started; the others are in
        `deploy.cli.boundary`.
    """
    words = sys.argv[1:] if argv is None else argv
    return contain(PROGRAM, words, lambda: _run(words))


def _run(argv: Sequence[str]) -> int:
    arguments = _parser().parse_args(argv)
    return _load(arguments.command).run(arguments)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=PROGRAM,
        description="Guide a formation of small drones with one hand.",
        epilog="example: swarmtouch up rhombus --seconds 30",
    )
    parser.add_argument(
        "--version", action=_Version, help="say which version, and which form of the law, this is"
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, summary in COMMANDS.items():
        command = _load(name)
        child = commands.add_parser(
            name,
            help=summary,
            description=command.DESCRIPTION,
            epilog=f"example: {command.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.add_arguments(child)
    return parser


class _Version(argparse.Action):
    """Looks for the version only when it is asked for."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str) -> None:  # noqa: A002  argparse's
        super().__init__(option_strings, dest, nargs=0, default=argparse.SUPPRESS, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Prints it and ends the program."""
        law = form()
        print(f"{parser.prog} {version(parser.prog)}, law {law} ({law.compiler or law.reason})")
        parser.exit()


def _load(name: str) -> Command:
    return cast(Command, importlib.import_module(f"deploy.cli.{name}"))
