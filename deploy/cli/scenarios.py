"""`swarmtouch scenarios`: what ships."""

import argparse
from pathlib import Path

from shared.config import SCENARIOS

DESCRIPTION = "Lists the scenarios that ship, each with its first comment."
EXAMPLE = "swarmtouch scenarios"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """There are none."""


def run(_: argparse.Namespace) -> int:
    """Prints one line per scenario."""
    paths = sorted(SCENARIOS.glob("*.toml"))
    width = max((len(path.stem) for path in paths), default=0)
    for path in paths:
        print(f"{path.stem:<{width}}  {_first_comment(path)}")
    return 0


def _first_comment(path: Path) -> str:
    lines = path.read_text(encoding="utf-8").splitlines()
    return next((line.lstrip("# ") for line in lines if line.startswith("#")), "")
