"""Compiles what `pyproject.toml` lists: `make compile`."""

import sys

from deploy.compile.build import compile_modules
from deploy.compile.recipe import CompileError, listed_modules
from shared.compiled import BUILT, ROOT


def main() -> int:
    """Compiles and returns the exit code."""
    try:
        compile_modules(ROOT, listed_modules(ROOT), ROOT / BUILT, say=print)
    except (CompileError, OSError) as error:
        print(f"not compiled: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
