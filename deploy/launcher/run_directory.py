"""The directory of one run: resolved scenario, logs, summary, referee."""

import itertools
import time
from collections.abc import Callable
from pathlib import Path

from observer.swarm import LATEST
from shared.errors import ConfigError


def create_run_directory(runs: Path, say: Callable[[str], None]) -> Path:
    """Creates `runs/<stamp>/` with `logs/` in it and points `runs/latest` at it.

    Args:
        runs: Directory of all runs; created if missing.
        say: Told if `runs/latest` cannot be pointed at it; that is no reason not to fly.

    Returns:
        The absolute path of the new directory; runs that start in the same second get different ones.

    Raises:
        ConfigError: No directory can be made there.
    """
    try:
        path = _create(runs.resolve())
    except (OSError, RuntimeError) as error:  # RuntimeError: a loop of links
        raise ConfigError(f"{runs}: no directory can be made there for this run: {error}") from error
    link = path.parent / LATEST
    try:
        _point(link, path.name)
    except OSError as error:
        say(f"{link} cannot be pointed at this run ({error}); name it to other commands: {path}")
    return path


def write_run_file(path: Path, text: str) -> None:
    """Writes a file of the run that its processes read.

    Raises:
        ConfigError: It cannot be written.
    """
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error}") from error


def _create(runs: Path) -> Path:
    stamp = time.strftime("%Y%m%d-%H%M%S")
    runs.mkdir(parents=True, exist_ok=True)
    for name in itertools.chain([stamp], (f"{stamp}-{n}" for n in itertools.count(2))):
        path = runs / name
        try:
            path.mkdir()
        except FileExistsError:
            continue
        break
    (path / "logs").mkdir()
    return path


def _point(link: Path, target: str) -> None:
    """Replaces the link in one step, so that it never dangles."""
    fresh = link.with_name(f".{LATEST}-{target}")
    fresh.symlink_to(target)
    try:
        fresh.replace(link)
    except OSError:
        fresh.unlink()
        raise
