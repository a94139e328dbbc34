"""Runs mypyc and the C compiler: `python native.py FOLDER FILE...`, from the folder of the packages.

A process of its own, because both write to standard output as they like, and end the process as they like.
"""

import sys
from pathlib import Path

from mypyc.build import mypycify
from setuptools import Distribution
from setuptools.command.build_ext import build_ext


def main(folder: Path, library: str, flags: list[str], files: list[str]) -> None:
    """Compiles.

    Args:
        folder: Where intermediate files go, and to its folder `out` the binaries.
        library: Name of the module with all code.
        flags: For the C compiler.
        files: The sources, relative.
    """
    group = library.removesuffix("__mypyc")
    # What these modules import may itself import what is not installed here; `make lint` checks all types.
    options = ["--cache-dir", str(folder / "mypy"), "--config-file", "", "--ignore-missing-imports"]
    # No line numbers of generated C: tracebacks have ours, and profilers the names of functions.
    extensions = mypycify([*options, *files], group_name=group, target_dir=str(folder / "c"), debug_level="0")
    for extension in extensions:
        extension.extra_compile_args += flags
    command = build_ext(Distribution({"name": group, "ext_modules": extensions}))
    command.build_lib, command.build_temp = str(folder / "out"), str(folder / "objects")
    command.ensure_finalized()
    command.run()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], sys.argv[3].split(), sys.argv[4:])
