"""Arguments that several commands take."""

import argparse
import os

from shared.process import OVERRIDES


def add_flight_arguments(parser: argparse.ArgumentParser, *, hand: str) -> None:
    """Declares what to fly: the scenario, the hand (with its default) and `--set`."""
    add_scenario_arguments(parser)
    parser.add_argument(
        "--hand",
        metavar="URI",
        default=hand,
        help="hand source: scripted:NAME, recording:PATH or pointer:// (default: %(default)s)",
    )


def add_scenario_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the scenario, and `--set KEY=VALUE`, repeatable, as `overrides`."""
    parser.add_argument("scenario", help="name of a scenario that ships, or a TOML file")
    add_overrides(parser)


def add_run(parser: argparse.ArgumentParser) -> None:
    """Declares which running swarm is meant, as `run`."""
    parser.add_argument(
        "run",
        nargs="?",
        metavar="RUN",
        help="run directory, scenario file, or a scenario that ships (default: the newest in runs/)",
    )


def add_overrides(parser: argparse.ArgumentParser) -> None:
    """Declares `--set KEY=VALUE`, repeatable, as `overrides`."""
    parser.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=os.environ.get(OVERRIDES, "").split(),
        metavar="KEY=VALUE",
        help="override a key of the scenario, for example formation.n=8; repeatable",
    )


def count(text: str) -> int:
    """Reads how many.

    Raises:
        argparse.ArgumentTypeError: It is not 1 or more.
    """
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} must be at least 1")
    return value


def seconds(text: str) -> float:
    """Reads a duration, s.

    Raises:
        argparse.ArgumentTypeError: It is not more than 0 and finite.
    """
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} must be more than 0")
    return value
