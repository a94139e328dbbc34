"""Compiling: what is read, when it is done again, and that nobody ever meets half of it."""

import importlib.metadata
import os
import sysconfig
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

from deploy.compile import build, recipe, toolchain
from deploy.compile.build import compile_modules
from deploy.compile.recipe import CompileError, listed_modules, write_recipe
from shared.compiled import LIBRARY, ROOT, Binaries, RefusedError, manifest_file, read_manifest

SOURCES = {
    "law/__init__.py": "",
    "law/first.py": "from law import second\nimport os, os.path\n",
    "law/second.py": "def far() -> float:\n    import other.place\n    return other.place.LIMIT\n",
    "law/unrelated.py": "",
    "other/__init__.py": "from .inner import thing\n",
    "other/inner/__init__.py": "",
    "other/inner/thing.py": "",
    "other/place.py": "LIMIT = 1.0\n",
}
READ = SOURCES.keys() - {"law/unrelated.py"}
STAND_IN = f"""
import os, pathlib, sys
folder, library, flags, *files = sys.argv[1:]
out = pathlib.Path(folder) / "out"
for name in (library, *(file.removesuffix(".py") for file in files)):
    binary = out / f"{{name}}{EXTENSION_SUFFIXES[0]}"
    binary.parent.mkdir(parents=True, exist_ok=True)
    binary.write_bytes(os.urandom(2000))
"""
"""Stands in for mypyc and the C compiler: no two of its binaries are the same, as with addresses in theirs."""


class House:
    def __init__(self, root: Path) -> None:
        self.root, self.place, self.said = root / "house", root / "compiled", list[str]()
        for path, text in SOURCES.items():
            self.write(path, text)

    def write(self, path: str, text: str) -> None:
        (self.root / path).parent.mkdir(parents=True, exist_ok=True)
        (self.root / path).write_text(text, encoding="utf-8")

    def compile(self, *modules: str) -> None:
        compile_modules(self.root, modules or ("law.first",), self.place, say=self.said.append)

    def check(self) -> None:
        manifest = read_manifest(manifest_file(self.place).read_text(encoding="utf-8"))
        Binaries(self.place, manifest, self.root).check()

    def folders(self) -> list[Path]:
        return [path for path in self.place.iterdir() if path.is_dir()]


@pytest.fixture
def house(tmp_path: Path) -> House:
    return House(tmp_path)


def stand_in(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, more: str = "") -> None:
    script = tmp_path / "stand_in.py"
    script.write_text(STAND_IN + more, encoding="utf-8")
    monkeypatch.setattr(build, "_NATIVE", script)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    stand_in(monkeypatch, tmp_path)


def test_everything_of_ours_that_the_compiler_reads_is_in_the_recipe(house: House) -> None:
    assert write_recipe(house.root, ["law.first"]).sources.keys() == READ


def test_a_listed_module_that_is_not_there_is_named(house: House) -> None:
    with pytest.raises(CompileError, match=r"no module law\.thrid, other"):
        write_recipe(house.root, ["law.first", "law.thrid", "other"])


def test_what_the_project_lists_is_there() -> None:
    modules = listed_modules(ROOT)
    assert modules
    sources = write_recipe(ROOT, modules).sources
    assert {f"{name.replace('.', '/')}.py" for name in modules} <= sources.keys()


@pytest.mark.usefixtures("quick")
def test_what_is_up_to_date_is_left_alone(house: House) -> None:
    house.compile()
    before = house.folders()
    house.check()
    house.compile()
    assert house.folders() == before
    assert "up to date" in house.said[-1]


def edit(house: House, _: pytest.MonkeyPatch) -> None:
    house.write("other/place.py", "LIMIT = 2.0\n")


def damage(house: House, _: pytest.MonkeyPatch) -> None:
    next(house.place.rglob("first.*")).write_bytes(b"")


def remove(house: House, _: pytest.MonkeyPatch) -> None:
    next(house.place.rglob(f"{LIBRARY}*")).unlink()


def spoil(house: House, _: pytest.MonkeyPatch) -> None:
    manifest_file(house.place).write_text("garbage", encoding="utf-8")


def other_compiler(_: House, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.metadata, "version", lambda _: "99.9")


def other_flags(_: House, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recipe, "FLAGS", ("-O2",))


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("change", [edit, damage, remove, spoil, other_compiler, other_flags])
def test_what_is_not_is_compiled_again(
    house: House, monkeypatch: pytest.MonkeyPatch, change: Callable[[House, pytest.MonkeyPatch], None]
) -> None:
    house.compile()
    change(house, monkeypatch)
    house.compile()
    house.check()
    assert "compiled" in house.said[-1]
    assert "up to date" not in house.said[-1]


@pytest.mark.usefixtures("quick")
def test_another_list_is_compiled_again(house: House) -> None:
    house.compile("law.first")
    house.compile("law.first", "law.second")
    house.check()
    assert any(house.place.rglob("second.*"))


def test_a_source_that_is_edited_meanwhile_does_not_match(
    house: House, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    stand_in(monkeypatch, tmp_path, f"pathlib.Path({str(house.root / 'law/first.py')!r}).write_text('')\n")
    house.compile()
    with pytest.raises(RefusedError, match=r"law/first\.py"):
        house.check()


def test_what_cannot_be_compiled_leaves_all_as_it_was(
    house: House, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    stand_in(monkeypatch, tmp_path)
    house.compile()
    before = house.folders()
    stand_in(monkeypatch, tmp_path, "sys.exit('law/first.py:3: error: no such luck')\n")
    house.write("law/second.py", "# edited\n")
    with pytest.raises(CompileError, match="no such luck"):
        house.compile()
    assert house.folders() == before
    with pytest.raises(RefusedError):
        house.check()


def test_a_place_that_cannot_be_written_to_is_named(house: House) -> None:
    house.place.write_text("", encoding="utf-8")
    with pytest.raises(OSError, match=str(house.place)):
        house.compile()


@pytest.mark.usefixtures("quick")
def test_builds_at_the_same_time_never_leave_half_of_one(house: House) -> None:
    """Whoever looks at any moment finds good binaries: of the first build, or of any later one."""
    house.compile()
    done = threading.Event()

    def look() -> int:
        looks = 0
        while not done.is_set():
            house.check()
            looks += 1
        return looks

    def build_again(_: int) -> None:
        # As in a checkout where nothing is up to date: everybody compiles.
        compile_modules(house.root, ("law.first",), house.place)

    with pytest.MonkeyPatch.context() as patch, ThreadPoolExecutor() as pool:
        patch.setattr(build, "is_current", lambda *_: False)
        looking = pool.submit(look)
        list(ThreadPoolExecutor(4).map(build_again, range(8)))
        done.set()
        assert looking.result() > 0
    assert not [path for path in house.folders() if path.name.startswith("new-")]


@pytest.mark.usefixtures("quick")
def test_binaries_that_nobody_names_any_more_go_after_a_day(house: House) -> None:
    house.compile()
    edit(house, pytest.MonkeyPatch())
    house.compile()
    assert len(house.folders()) == 2
    for folder in house.folders():
        os.utime(folder, (0, 0))
    house.write("law/second.py", "# edited\n")
    house.compile()
    assert len(house.folders()) == 1
    house.check()


def test_a_machine_without_a_compiler_is_told_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler -pthread")
    monkeypatch.setattr(sysconfig, "get_path", lambda _: "/no/such/folder")
    assert toolchain.main() == 1
    said = capsys.readouterr().err
    assert "no-such-compiler`" in said
    assert "python3-dev" in said
