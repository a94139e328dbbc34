"""Runs a module as `python -m` does, and writes down which modules it had loaded when it ended.

`python -P tests/loaded_modules.py FOLDER MODULE [arguments]`
"""

import runpy
import sys
from pathlib import Path


def main() -> None:
    folder, module = Path(sys.argv.pop(1)), sys.argv.pop(1)
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    finally:
        (folder / f"{module}.modules").write_text("\n".join(sorted(sys.modules)), encoding="utf-8")


if __name__ == "__main__":
    main()
