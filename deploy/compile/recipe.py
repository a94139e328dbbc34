"""What goes into the binaries: the listed modules, and all sources of ours that the compiler reads for them."""

import ast
import importlib.metadata
import tomllib
from collections.abc import Iterator, Sequence
from importlib.util import resolve_name
from pathlib import Path

from shared.compiled import ABI, Recipe, hash_of_file

FLAGS = ("-O3", "-ffp-contract=off")
"""The second forbids the compiler to fuse a product and a sum, which aarch64 can and Python does not: so both
forms agree to the last bit."""


class CompileError(Exception):
    """The law cannot be compiled; says why."""


def listed_modules(root: Path) -> tuple[str, ...]:
    """Returns the modules to compile: `compiled` under `[tool.swarmtouch]` in `pyproject.toml`."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    return tuple(sorted(project["tool"]["swarmtouch"]["compiled"]))


def write_recipe(root: Path, modules: Sequence[str]) -> Recipe:
    """Returns the recipe for some modules as they are on disk now.

    Args:
        root: The folder of the packages.
        modules: Names.

    Raises:
        CompileError: A module is not there, or is a package.
        SyntaxError: A source is not Python.
    """
    absent = [name for name in modules if not _module_file(root, name).exists()]
    if absent:
        raise CompileError(f"pyproject.toml, [tool.swarmtouch] compiled: no module {', '.join(absent)}")
    compiler = f"mypyc {importlib.metadata.version('mypy')} {' '.join(FLAGS)}"
    sources = {path: hash_of_file(root / path) for path in sorted(_read_for(root, modules))}
    return Recipe(ABI, compiler, tuple(modules), sources)


def _read_for(root: Path, modules: Sequence[str]) -> set[str]:
    """Returns paths below the root: the modules, all they import of ours, the packages around these."""
    paths: set[str] = set()
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        for file in (_module_file(root, name), root / name.replace(".", "/") / "__init__.py"):
            path = file.relative_to(root).as_posix()
            if path in paths or not file.exists():
                continue
            paths.add(path)
            package = name if file.name == "__init__.py" else name.rpartition(".")[0]
            waiting += [*_parents(name), *_imported(file, package)]
    return paths


def _imported(file: Path, package: str) -> Iterator[str]:
    """Yields the names of modules that a source may import, wherever it does."""
    for node in ast.walk(ast.parse(file.read_bytes(), file)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name
        elif isinstance(node, ast.ImportFrom):
            module = resolve_name("." * node.level + (node.module or ""), package)
            yield module
            yield from (f"{module}.{alias.name}" for alias in node.names)


def _parents(name: str) -> Iterator[str]:
    parts = name.split(".")
    return (".".join(parts[:length]) for length in range(1, len(parts)))


def _module_file(root: Path, name: str) -> Path:
    return root / f"{name.replace('.', '/')}.py"
