"""Arguments that several commands take."""

import argparse
import os
from collections.abc import Callable
from pathlib import Path

from shared.overrides import split_overrides
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
        default=split_overrides(os.environ.get(OVERRIDES, "")),
        metavar="KEY=VALUE",
        help="override a key of the scenario, for example formation.n=8; repeatable",
    )


def whole(low: int, high: int) -> Callable[[str], int]:
    """Returns a reader of whole numbers from `low` to `high`."""
    return lambda text: int(_within(text, int, low, high))


def number(low: float, high: float) -> Callable[[str], float]:
    """Returns a reader of numbers from `low` to `high`."""
    return lambda text: _within(text, float, low, high)


count = whole(1, 1_000_000)
seconds = number(0.001, 1_000_000.0)
"""Longer than eleven days is a mistake, and more than some clocks of the system take."""


def new_file(text: str) -> Path:
    """Takes a file that is to be written, and looks whether it can be before hours have been spent on it.

    Raises:
        argparse.ArgumentTypeError: It cannot.
    """
    path = Path(text)
    try:
        if path.is_dir():
            raise argparse.ArgumentTypeError(f"{path} is a folder")
        if not path.parent.is_dir():
            raise argparse.ArgumentTypeError(f"{path}: there is no folder {path.parent}")
        _check_writable(path if path.exists() else path.parent)
    except (OSError, ValueError) as error:
        raise argparse.ArgumentTypeError(f"{path}: {error}") from error
    return path


def new_folder(text: str) -> Path:
    """Takes a folder that files are to be written to, there or not, as `new_file` does.

    Raises:
        argparse.ArgumentTypeError: Nothing can be written to it.
    """
    path = Path(text)
    try:
        nearest = next(place for place in (path, *path.parents, Path()) if os.path.lexists(place))
        if not nearest.is_dir():
            raise argparse.ArgumentTypeError(f"{path}: {nearest} is no folder")
        _check_writable(nearest)
    except (OSError, ValueError) as error:
        raise argparse.ArgumentTypeError(f"{path}: {error}") from error
    return path


def _within(text: str, kind: Callable[[str], float], low: float, high: float) -> float:
    try:
        value = kind(text)
    except ValueError:
        sort = "whole number" if kind is int else "number"
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is no {sort}") from None
    if not low <= value <= high:
        raise argparse.ArgumentTypeError(f"{text[:40]} must be {low:,.12g} to {high:,.12g}")
    return value


def _check_writable(path: Path) -> None:
    if not os.access(path, os.W_OK):
        raise argparse.ArgumentTypeError(f"{path} cannot be written to")
