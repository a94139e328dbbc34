"""What compiling needs of a machine: `python -m deploy.compile.toolchain` says what is missing."""

import os
import shlex
import shutil
import sys
import sysconfig
from pathlib import Path

COST = "a control step takes five times as long"
"""What the pure form costs, in a loop (`swarmtouch bench step`)."""


def c_compiler() -> str:
    """Returns the command that compiles C for this Python: `$CC`, or what Python itself was built with."""
    return shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")[0]


def missing() -> tuple[str, ...]:
    """Returns what is missing, each with what to do; nothing where the law can be compiled."""
    found = []
    if shutil.which(c_compiler()) is None:
        found.append(f"no C compiler `{c_compiler()}` (Debian: apt-get install gcc libc6-dev)")
    header = Path(sysconfig.get_path("include")) / "Python.h"
    if not header.exists():
        found.append(f"no {header} (Debian: apt-get install python3-dev)")
    return tuple(found)


def main() -> int:
    """Says what is missing; returns the exit code."""
    for what in missing():
        print(f"not compiled: {what}. Everything works without; {COST}", file=sys.stderr)
    return 1 if missing() else 0


if __name__ == "__main__":
    sys.exit(main())
