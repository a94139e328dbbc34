"""The compiled form is imported only where it is true to the sources; all else falls back to the pure one."""

import contextlib
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.compile.toolchain import c_compiler, missing
from shared.compiled import (
    ABI,
    BUILT,
    LIBRARY,
    PURE,
    ROOT,
    SHIPPED,
    Manifest,
    Recipe,
    hash_of_file,
    manifest_file,
    read_manifest,
)

SUFFIX = EXTENSION_SUFFIXES[0]
SOURCES = {
    "law/__init__.py": "import shared\n",
    "law/first.py": "from law.limits import LIMIT\nFORM = 'pure'\n",
    "law/limits.py": "LIMIT = 1\n",
}
C_SOURCE = """
#include <Python.h>
static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "%(name)s", NULL, -1, NULL};
PyMODINIT_FUNC PyInit_%(name)s(void) {
    PyObject *made = PyModule_Create(&module);
    PyModule_AddStringConstant(made, "FORM", "compiled");
    return made;
}
"""
ASK = (
    "import law.first; from shared.compiled import form; used = form();"
    "print(law.first.FORM, used, used.refused, used.reason, sep='|')"
)


class House:
    """A small house of packages with one module, `law.first`, whose binaries somebody has made."""

    def __init__(self, root: Path, binaries: Path) -> None:
        self.root = root
        for name in ("__init__", "compiled"):
            self.write(f"shared/{name}.py", (ROOT / f"shared/{name}.py").read_text(encoding="utf-8"))
        for path, text in SOURCES.items():
            self.write(path, text)
        files = {LIBRARY: f"{LIBRARY}{SUFFIX}", "law.first": f"law/first{SUFFIX}"}
        hashes = {name: (file, hash_of_file(binaries / Path(file).name)) for name, file in files.items()}
        sources = {path: hash_of_file(root / path) for path in SOURCES}
        self.manifest = Manifest(Recipe(ABI, "cc", ("law.first",), sources), hashes)
        self.place = root / BUILT
        for file in files.values():
            self.binary(file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(binaries / Path(file).name, self.binary(file))
        self.publish(self.manifest)

    def write(self, path: str, text: str) -> None:
        (self.root / path).parent.mkdir(parents=True, exist_ok=True)
        (self.root / path).write_text(text, encoding="utf-8")

    def binary(self, file: str = f"law/first{SUFFIX}") -> Path:
        return self.place / self.manifest.folder / file

    def publish(self, manifest: Manifest) -> None:
        manifest_file(self.place).write_text(manifest.text(), encoding="utf-8")

    def ask(self, **environment: str) -> tuple[str, str, bool, str]:
        """Imports the module in a process of its own: what it is, the form, whether refused, and why."""
        code = f"import sys; sys.path.insert(0, {str(self.root)!r}); {ASK}"
        own = {key: value for key, value in os.environ.items() if key != PURE} | environment
        done = subprocess.run(
            [sys.executable, "-P", "-B", "-c", code], check=True, capture_output=True, text=True, env=own
        )
        assert done.stderr == ""
        module, form, refused, reason = done.stdout.strip().split("|")
        return module, form, refused == "True", reason


@pytest.fixture(scope="session")
def binaries(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two extension modules that any C compiler makes in no time."""
    if missing():
        pytest.skip("; ".join(missing()))
    folder = tmp_path_factory.mktemp("binaries")
    for name in (LIBRARY, "first"):
        source = folder / f"{name}.c"
        source.write_text(C_SOURCE % {"name": name}, encoding="utf-8")
        include = f"-I{sysconfig.get_path('include')}"
        subprocess.run(
            [c_compiler(), "-shared", "-fPIC", include, "-o", f"{folder / name}{SUFFIX}", source], check=True
        )
    return folder


@pytest.fixture
def house(tmp_path: Path, binaries: Path) -> House:
    return House(tmp_path, binaries)


def test_binaries_that_are_true_to_the_sources_are_imported(house: House) -> None:
    assert house.ask() == ("compiled", f"compiled {house.manifest.recipe.digest[:8]}", False, "")


def test_binaries_that_came_with_the_package_are_imported(house: House) -> None:
    (house.root / BUILT).rename(house.root / SHIPPED)
    assert house.ask()[0] == "compiled"


def test_a_variable_asks_for_the_pure_form(house: House) -> None:
    assert house.ask(**{PURE: "1"}) == ("pure", "pure", False, f"{PURE} is set")
    assert house.ask(**{PURE: "0"})[0] == house.ask(**{PURE: ""})[0] == "compiled"


@pytest.mark.parametrize("path", SOURCES)
def test_a_source_that_was_edited_is_what_runs(house: House, path: str) -> None:
    """A module that is only imported by a compiled one as well: the compiler copies constants out of it."""
    house.write(path, SOURCES[path] + "# edited\n")
    assert house.ask() == ("pure", "pure", True, f"{path} is not what was compiled")


def test_the_same_source_again_is_compiled_again(house: House) -> None:
    house.write("law/first.py", "FORM = 'edited'\n")
    assert house.ask()[0] == "edited"
    house.write("law/first.py", SOURCES["law/first.py"])
    assert house.ask()[0] == "compiled"


def test_another_python_does_not_import_them(house: House) -> None:
    manifest_file(house.place).rename(house.place / "cpython-399-x86_64-linux-gnu.txt")
    assert house.ask() == ("pure", "pure", False, f"not compiled for {ABI}")


def test_binaries_under_a_wrong_name_are_refused(house: House) -> None:
    recipe = house.manifest.recipe._replace(abi="cpython-399-x86_64-linux-gnu")
    foreign = house.manifest._replace(recipe=recipe)
    house.binary().parents[1].rename(house.place / foreign.folder)
    house.publish(foreign)
    module, _, refused, reason = house.ask()
    assert (module, refused) == ("pure", True)
    assert "cpython-399" in reason


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def flip(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)


def empty(file: Path) -> None:
    file.write_bytes(b"")


@pytest.mark.parametrize("damage", [cut, flip, empty, Path.unlink])
@pytest.mark.parametrize("file", [f"law/first{SUFFIX}", f"{LIBRARY}{SUFFIX}"])
def test_damaged_binaries_are_refused_and_nothing_crashes(
    house: House, file: str, damage: Callable[[Path], None]
) -> None:
    damage(house.binary(file))
    module, form, refused, reason = house.ask()
    assert (module, form, refused) == ("pure", "pure", True)
    assert str(house.binary(file)) in reason


def test_binaries_that_this_machine_cannot_load_are_refused(house: House) -> None:
    """As those of a newer C library, or of another processor: good for the manifest, not for the loader."""
    house.binary(f"{LIBRARY}{SUFFIX}").write_bytes(b"\x7fELF of another world")
    library = (f"{LIBRARY}{SUFFIX}", hash_of_file(house.binary(f"{LIBRARY}{SUFFIX}")))
    foreign = house.manifest._replace(binaries=dict(house.manifest.binaries) | {LIBRARY: library})
    house.binary().parents[1].rename(house.place / foreign.folder)
    house.publish(foreign)
    module, form, refused, reason = house.ask()
    assert (module, form, refused) == ("pure", "pure", True)
    assert LIBRARY in reason


@pytest.mark.parametrize("content", [b"", b"garbage", b"\xff\xfe", b"swarmtouch compiled 2\na\nb\nc\n\n"])
def test_a_damaged_manifest_is_refused(house: House, content: bytes) -> None:
    manifest_file(house.place).write_bytes(content)
    module, form, refused, reason = house.ask()
    assert (module, form, refused) == ("pure", "pure", True)
    assert manifest_file(house.place).name in reason


def test_importing_writes_nothing(house: House) -> None:
    """An installation may be read-only."""
    before = sorted(house.root.rglob("*"))
    assert house.ask()[0] == "compiled"
    flip(house.binary())
    assert house.ask()[0] == "pure"
    assert sorted(house.root.rglob("*")) == before


words = st.text("abc/._-", min_size=1)
manifests = st.builds(
    Manifest,
    st.builds(
        Recipe,
        words,
        words,
        st.lists(words, min_size=1).map(tuple),
        st.dictionaries(words | st.just("a b.py"), words),
    ),
    st.dictionaries(words, st.tuples(words, words), min_size=1),
)


@given(manifests)
def test_a_manifest_is_read_as_it_was_written(manifest: Manifest) -> None:
    assert read_manifest(manifest.text()) == manifest


@given(manifests, st.data())
def test_no_cut_manifest_is_another_one(manifest: Manifest, data: st.DataObject) -> None:
    text = manifest.text()
    cut = text[: data.draw(st.integers(0, len(text) - 1))]
    try:
        read = read_manifest(cut)
    except ValueError:
        return
    assert (read.folder == manifest.folder) == (cut == text.removesuffix("\n"))


@given(st.text())
def test_any_text_is_a_manifest_or_refused(text: str) -> None:
    with contextlib.suppress(ValueError):
        read_manifest(text)
