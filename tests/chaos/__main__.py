"""Chaos: `python -m tests.chaos [PLAN...] [--csv FILE] [--logs DIR]`, as root. Exit code 0: all as designed."""

import argparse
import sys
import tempfile
from pathlib import Path

from rich.console import Console

from tests.chaos.lab import obstacle
from tests.chaos.plans import PLANS
from tests.chaos.row import Row, print_table, write_csv


def main() -> int:
    """Flies the plans one after the other and prints the table."""
    arguments = _parse()
    reason = obstacle()
    if reason:
        print(f"chaos: {reason}", file=sys.stderr)
        return 2
    console = Console(highlight=False, width=None if sys.stdout.isatty() else 200)
    rows: list[Row] = []
    for name in arguments.plans or PLANS:
        rows.append(PLANS[name](arguments.logs / name))
        console.print(f"{name}: {', '.join((*rows[-1].failures, *rows[-1].late)) or 'as designed'}")
    print_table(rows, console)
    if arguments.csv:
        write_csv(rows, arguments.csv)
    return 1 if any(row.failures or row.late for row in rows) else 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.chaos", description=__doc__)
    parser.add_argument("plans", nargs="*", metavar="PLAN", help=f"some of: {', '.join(PLANS)} (default: all)")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the table there, too")
    parser.add_argument("--logs", type=Path, metavar="DIR", help="where logs go (default: a new folder)")
    arguments = parser.parse_args()
    unknown = set(arguments.plans) - set(PLANS)
    if unknown:
        parser.error(f"no plan {', '.join(sorted(unknown))}; known: {', '.join(PLANS)}")
    arguments.logs = arguments.logs or Path(tempfile.mkdtemp(prefix="chaos-"))
    return arguments


if __name__ == "__main__":
    sys.exit(main())
