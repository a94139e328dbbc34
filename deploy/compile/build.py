"""Makes binaries beside others that may be in use, and other builds that may be under way.

What is compiled is a copy of the sources, so nobody can change them meanwhile; the copy is what the manifest
names. Binaries lie in a folder that has its name from their manifest and is never written to again. The one
thing that is ever replaced, at once, is the manifest.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

from deploy.compile.recipe import FLAGS, CompileError, write_recipe
from shared.compiled import (
    LIBRARY,
    Binaries,
    Manifest,
    Recipe,
    RefusedError,
    hash_of_file,
    manifest_file,
    read_manifest,
)

KEPT_S = 24 * 3600.0
"""Folders that no manifest names any more stay this long: a process may be about to load what is in them."""
_SHOWN = 30
"""Lines of output that an error shows."""
_NATIVE = Path(__file__).with_name("native.py")


def compile_modules(
    root: Path, modules: Sequence[str], place: Path, say: Callable[[str], None] = lambda _: None
) -> Recipe:
    """Compiles modules unless good binaries of them are there already.

    Args:
        root: The folder of the packages.
        modules: Names.
        place: Where the manifest and the folders of binaries lie.
        say: Told what is going on.

    Returns:
        What the binaries were made from.

    Raises:
        CompileError: They cannot be compiled.
        OSError: The place cannot be written to.
    """
    recipe = write_recipe(root, modules)
    if is_current(recipe, place, root):
        say(f"compiled {recipe.digest[:8]} is up to date")
        return recipe
    place.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="new-", dir=place) as folder:
        work = Path(folder)
        recipe = _copy(root, recipe, work / "sources")
        say(f"compiling {len(modules)} modules ({recipe.compiler}), it takes a minute")
        started = time.monotonic()
        _run(work, recipe)
        manifest = Manifest(recipe, _binaries(work / "out"))
        _publish(work / "out", manifest, place)
    say(f"compiled {recipe.digest[:8]} in {time.monotonic() - started:.0f} s")
    _tidy(place)
    return recipe


def is_current(recipe: Recipe, place: Path, root: Path) -> bool:
    """Says whether good binaries of this recipe are there."""
    try:
        manifest = read_manifest(manifest_file(place).read_text(encoding="utf-8"))
        Binaries(place, manifest, root).check()
    except (OSError, ValueError, RefusedError):
        return False
    return manifest.recipe.digest == recipe.digest


def _copy(root: Path, recipe: Recipe, to: Path) -> Recipe:
    """Copies the sources; returns the recipe of the copy."""
    for path in recipe.sources:
        (to / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(root / path, to / path)
    return recipe._replace(sources={path: hash_of_file(to / path) for path in recipe.sources})


def _run(work: Path, recipe: Recipe) -> None:
    files = [f"{name.replace('.', '/')}.py" for name in recipe.modules]
    command = [sys.executable, "-P", str(_NATIVE), str(work), LIBRARY, " ".join(FLAGS), *files]
    # Flags of the environment might let the two forms differ.
    environment = {key: value for key, value in os.environ.items() if key not in ("CFLAGS", "CPPFLAGS")}
    done = subprocess.run(
        command,
        cwd=work / "sources",
        env=environment,
        check=False,
        capture_output=True,
        encoding="utf-8",
        errors="replace",
    )
    if done.returncode:
        lines = [*done.stdout.splitlines(), *done.stderr.splitlines()]
        raise CompileError("\n".join(["mypyc or the C compiler failed:", *lines[-_SHOWN:]]))


def _binaries(out: Path) -> dict[str, tuple[str, str]]:
    """Returns the files by module, with their hashes."""
    files = {
        file.relative_to(out).as_posix(): hash_of_file(file) for file in out.rglob(f"*{EXTENSION_SUFFIXES[0]}")
    }
    return {
        file.removesuffix(EXTENSION_SUFFIXES[0]).replace("/", "."): (file, digest)
        for file, digest in files.items()
    }


def _publish(out: Path, manifest: Manifest, place: Path) -> None:
    folder, file = place / manifest.folder, manifest_file(place)
    if folder.exists() and _binaries(folder) != manifest.binaries:  # damaged
        folder.rename(out.parent / "damaged")
    if not folder.exists():
        out.rename(folder)
    new = out.parent / file.name
    new.write_text(manifest.text(), encoding="utf-8")
    new.replace(file)


def _tidy(place: Path) -> None:
    """Removes binaries that no manifest has named for a while."""
    named = {read_manifest(file.read_text(encoding="utf-8")).folder for file in place.glob("*.txt")}
    for folder in place.iterdir():
        if folder.is_dir() and folder.name not in named and time.time() - folder.stat().st_mtime > KEPT_S:
            shutil.rmtree(folder, ignore_errors=True)
