"""Which form of the law a process runs: compiled where a binary is true to the sources on disk, else pure.

The modules that `pyproject.toml` lists are plain Python, and are imported as such where there is nothing
better. `make compile` (`deploy/compile`) also makes binaries of them, in a folder of its own, and a manifest
that names by its hash every source whose content went into them. The finder below serves them only while these
sources, Python's ABI and the binaries themselves are what the manifest says: what is stale, foreign or damaged
is never loaded. All or none: a class of one form is not the class of the other. `SWARMTOUCH_PURE=1` asks for
the pure form.
"""

import os
import sys
from collections.abc import Mapping, Sequence
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, ModuleSpec
from importlib.util import decode_source, module_from_spec, source_hash
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

PURE = "SWARMTOUCH_PURE"
"""Environment variable that asks for the pure form."""
ROOT = Path(__file__).parent.parent
"""The folder of the packages: a checkout, or `site-packages`."""
SHIPPED = "shared/_compiled"
"""Below the root: where binaries lie that came with the package."""
BUILT = "build/compiled"
"""Below the root: where `make compile` puts them in a checkout."""
ABI = EXTENSION_SUFFIXES[0].split(".")[1]
"""What binaries must have been built for, for example `cpython-311-x86_64-linux-gnu`."""
LIBRARY = "swarmtouch__mypyc"
"""The module that holds all compiled code; those with the names of the sources hand out what is in it."""

_HEAD = "swarmtouch compiled 1"


class Recipe(NamedTuple):
    """What binaries are made from.

    Attributes:
        abi: See `ABI`.
        compiler: Its versions and flags.
        modules: The compiled ones.
        sources: Path below the root -> hash, of everything that the compiler reads of ours.
    """

    abi: str
    compiler: str
    modules: tuple[str, ...]
    sources: Mapping[str, str]

    def text(self) -> str:
        """Returns it in one line per fact."""
        sources = (f"{path} {digest}" for path, digest in sorted(self.sources.items()))
        return "\n".join([_HEAD, self.abi, self.compiler, " ".join(self.modules), *sources])

    @property
    def digest(self) -> str:
        """Hash of all of it: the name of a form."""
        return hash_of(self.text().encode())


class Manifest(NamedTuple):
    """Binaries that lie in a folder.

    Attributes:
        recipe: What they were made from.
        binaries: Name of a module -> file in the folder, and its hash.
    """

    recipe: Recipe
    binaries: Mapping[str, tuple[str, str]]

    def text(self) -> str:
        """Returns it as `read_manifest` reads it."""
        binaries = (f"{name} {file} {digest}\n" for name, (file, digest) in sorted(self.binaries.items()))
        return f"{self.recipe.text()}\n\n{''.join(binaries)}"

    @property
    def folder(self) -> str:
        """Name of the folder with the binaries: no other binaries ever get it."""
        return hash_of(self.text().encode())


class Form(NamedTuple):
    """The form of the law in a process.

    Attributes:
        digest: Of the compiled form's recipe; empty for the pure form.
        compiler: What made it; empty for the pure form.
        reason: Why it is the pure form; empty for the compiled one.
        refused: Whether there are binaries for this process, and they are not good.
    """

    digest: str = ""
    compiler: str = ""
    reason: str = ""
    refused: bool = False

    def __str__(self) -> str:
        """The form in a word or two, for example `compiled 3f2a91c0`."""
        return f"compiled {self.digest[:8]}" if self.digest else "pure"


class RefusedError(Exception):
    """These binaries must not be loaded; says why."""


def hash_of(content: bytes) -> str:
    """Returns the hash that sources and binaries are compared by: the one Python has for sources."""
    return source_hash(content).hex()


def hash_of_file(file: Path) -> str:
    """Returns the hash of a file's content."""
    # Without Python's buffers: a start looks at some eighty files.
    with open(file, "rb", buffering=0) as opened:
        return hash_of(opened.read())


def manifest_file(folder: Path) -> Path:
    """Returns where the manifest for this Python lies in a folder of binaries."""
    return folder / f"{ABI}.txt"


def read_manifest(text: str) -> Manifest:
    """Reads a manifest.

    Raises:
        ValueError: It is none.
    """
    recipe, _, binaries = text.partition("\n\n")
    head, abi, compiler, modules, *sources = recipe.split("\n")
    if head != _HEAD:
        raise ValueError(f"begins with {head!r}")
    return Manifest(
        Recipe(abi, compiler, tuple(modules.split()), dict(_split(line, 1) for line in sources)),
        {name: (file, digest) for name, file, digest in (_split(line, 2) for line in binaries.splitlines())},
    )


class CompiledLoader(ExtensionFileLoader):
    """Loads a module from a binary, and has the source at hand for whoever shows a traceback.

    Args:
        name: Of the module.
        path: The binary.
        source: What it was made from.
    """

    def __init__(self, name: str, path: str, source: Path) -> None:
        super().__init__(name, path)
        self._source = source

    def exec_module(self, module: ModuleType) -> None:
        """See `importlib.abc.Loader`; mypyc has set a loader of its own, of which nobody gets a source."""
        super().exec_module(module)
        module.__loader__ = self

    def get_source(self, fullname: str) -> str | None:  # type: ignore[override]  # extensions have none
        """See `importlib.abc.InspectLoader`; None if there is none to be read."""
        del fullname
        try:
            return decode_source(self._source.read_bytes())
        except (OSError, SyntaxError, UnicodeDecodeError):
            return None


class Binaries:
    """Binaries on disk.

    Args:
        place: The folder with the manifest.
        manifest: What is there.
        root: See `ROOT`.
    """

    def __init__(self, place: Path, manifest: Manifest, root: Path) -> None:
        self.manifest = manifest
        self._folder, self._root = place / manifest.folder, root

    def check(self) -> None:
        """Compares sources and binaries with the manifest.

        Raises:
            RefusedError: They differ.
            OSError: One cannot be read.
        """
        if self.manifest.recipe.abi != ABI:
            raise RefusedError(f"compiled for {self.manifest.recipe.abi}, this is {ABI}")
        for path, digest in self.manifest.recipe.sources.items():
            if hash_of_file(self._root / path) != digest:
                raise RefusedError(f"{path} is not what was compiled")
        for file, digest in self.manifest.binaries.values():
            if hash_of_file(self._folder / file) != digest:
                raise RefusedError(f"{self._folder / file} is damaged")

    def load(self) -> None:
        """Loads all code at once, so that what this machine cannot load is not found out halfway.

        Raises:
            ImportError: It cannot.
        """
        sys.modules[LIBRARY] = module_from_spec(self.spec(LIBRARY))
        try:
            self.loader(LIBRARY).exec_module(sys.modules[LIBRARY])
        except ImportError:
            del sys.modules[LIBRARY]
            raise

    def loader(self, name: str) -> CompiledLoader:
        """Returns what loads a module."""
        source = self._root / f"{name.replace('.', '/')}.py"
        return CompiledLoader(name, str(self._folder / self.manifest.binaries[name][0]), source)

    def spec(self, name: str) -> ModuleSpec:
        """Returns how a module is imported."""
        loader = self.loader(name)
        spec = ModuleSpec(name, loader, origin=loader.path)
        spec.has_location = True
        return spec


class CompiledFinder:
    """Finds listed modules in their compiled form; looks once whether it may.

    Args:
        root: See `ROOT`.
    """

    def __init__(self, root: Path) -> None:
        self._binaries, self._form = _find(root)

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """See `importlib.abc.MetaPathFinder`."""
        del path, target
        if self._binaries is None or name not in self._binaries.manifest.binaries:
            return None
        return self._binaries.spec(name) if self.form().digest else None

    def form(self) -> Form:
        """Returns the form of the law in this process; the first time it compares and loads."""
        if self._form is None:
            self._form = self._load()
        return self._form

    def _load(self) -> Form:
        assert self._binaries is not None  # noqa: S101  else the form is known
        try:
            self._binaries.check()
            self._binaries.load()
        except (RefusedError, OSError, ImportError, KeyError) as error:
            return Form(reason=str(error), refused=True)
        recipe = self._binaries.manifest.recipe
        return Form(recipe.digest, recipe.compiler)


def prefer_compiled() -> None:
    """Has listed modules imported in their compiled form from now on; the packages that have some call it."""
    if not any(isinstance(finder, CompiledFinder) for finder in sys.meta_path):
        sys.meta_path.insert(0, CompiledFinder(ROOT))


def form() -> Form:
    """Returns the form in which this process runs the law, or would if it had any use for it."""
    return next(finder.form() for finder in sys.meta_path if isinstance(finder, CompiledFinder))


def pure_is_asked_for() -> bool:
    """Says whether the environment asks for the pure form."""
    return os.environ.get(PURE, "0") not in ("", "0")


def _find(root: Path) -> tuple[Binaries | None, Form | None]:
    """Returns the binaries for this process, or why it has to be the pure form."""
    if pure_is_asked_for():
        return None, Form(reason=f"{PURE} is set")
    for place in (root / SHIPPED, root / BUILT):
        file = manifest_file(place)
        try:
            return Binaries(place, read_manifest(file.read_text(encoding="utf-8")), root), None
        except FileNotFoundError:
            continue
        except (OSError, ValueError) as error:
            return None, Form(reason=f"{file}: {error}", refused=True)
    return None, Form(reason=f"not compiled for {ABI}")


def _split(line: str, number: int) -> list[str]:
    """Splits the last fields off a line; a path may have spaces in it."""
    return line.rsplit(" ", number)
