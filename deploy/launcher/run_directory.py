"""The directory of one run: resolved scenario, logs, summary, referee."""

import itertools
import time
from pathlib import Path

from observer.swarm import LATEST


def create_run_directory(runs: Path) -> Path:
    """Creates `runs/<stamp>/` with `logs/` in it and points `runs/latest` at it.

    Args:
        runs: Directory of all runs; created if missing.

    Returns:
        The absolute path of the new directory; runs that start in the same second get different ones.

    Raises:
        OSError: The directory cannot be written.
    """
    runs = runs.resolve()
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
    _point(runs / LATEST, name)
    return path


def _point(link: Path, target: str) -> None:
    """Replaces the link in one step, so that it never dangles."""
    fresh = link.with_name(f".{LATEST}-{target}")
    fresh.symlink_to(target)
    fresh.replace(link)
