"""What `uv build` makes: a wheel for every Python and a compiled one; each is installed, asked, and flown."""

import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import NamedTuple

import pytest

from deploy.compile.recipe import listed_modules
from deploy.compile.toolchain import missing
from shared.compiled import ABI, PURE, SHIPPED

pytestmark = [pytest.mark.timeout(900), pytest.mark.packaging]

ROOT = Path(__file__).resolve().parents[2]
KINDS = ("pure", "compiled")


def uv() -> str:
    return str(ROOT / ".bootstrap/uv") if (ROOT / ".bootstrap/uv").exists() else shutil.which("uv") or "uv"


def run(*command: str | Path, folder: Path = ROOT, **environment: str) -> str:
    # As on a machine of somebody else: no path of ours, and no environment that is active.
    own = ("PYTHONPATH", "VIRTUAL_ENV", PURE)
    clean = {key: value for key, value in os.environ.items() if key not in own} | environment
    done = subprocess.run(command, cwd=folder, env=clean, check=False, capture_output=True, text=True)
    assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Built from the source distribution, so that holds all that building takes."""
    if missing():
        pytest.skip("; ".join(missing()))
    folder = tmp_path_factory.mktemp("dist")
    run(uv(), "build", "--quiet", "--python", sys.executable, "--out-dir", folder)
    found = {"pure" if "none-any" in file.name else "compiled": file for file in folder.glob("*.whl")}
    assert set(found) == set(KINDS)
    return found


class Installed(NamedTuple):
    """A wheel in an environment of its own."""

    kind: str
    folder: Path

    def ask(self, *arguments: str | Path, **environment: str) -> str:
        return run(self.folder / "env/bin/swarmtouch", *arguments, folder=self.folder, **environment)

    @property
    def packages(self) -> Path:
        return next((self.folder / "env/lib").glob("python*/site-packages"))


@pytest.fixture(scope="module", params=KINDS)
def installed(
    request: pytest.FixtureRequest, wheels: dict[str, Path], tmp_path_factory: pytest.TempPathFactory
) -> Installed:
    folder = tmp_path_factory.mktemp(request.param)
    locked = folder / "locked.txt"
    options = ("--quiet", "--frozen", "--no-dev", "--no-emit-project", "--no-hashes")
    run(uv(), "export", *options, "--output-file", locked)
    run(uv(), "venv", "--quiet", "--python", sys.executable, folder / "env")
    into = ("--python", folder / "env/bin/python", "--constraints", locked)
    run(uv(), "pip", "install", "--quiet", *into, wheels[request.param])
    return Installed(request.param, folder)


def test_the_pure_wheel_is_for_every_python_and_has_no_binary(wheels: dict[str, Path]) -> None:
    assert wheels["pure"].name.endswith("-py3-none-any.whl")
    with zipfile.ZipFile(wheels["pure"]) as wheel:
        names = wheel.namelist()
        (tags,) = (wheel.read(name).decode() for name in names if name.endswith("dist-info/WHEEL"))
    assert not [name for name in names if name.startswith(SHIPPED) or name.endswith((".so", ".c"))]
    assert "Root-Is-Purelib: true" in tags


def test_the_compiled_wheel_is_for_this_python_here_and_has_the_same_sources(wheels: dict[str, Path]) -> None:
    this = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    assert re.search(rf"-{this}-{this}-\w+\.whl$", wheels["compiled"].name)
    with zipfile.ZipFile(wheels["compiled"]) as wheel, zipfile.ZipFile(wheels["pure"]) as pure:
        ours = {name for name in wheel.namelist() if ".dist-info/" not in name}
        assert {name for name in pure.namelist() if ".dist-info/" not in name} == {
            name for name in ours if not name.startswith(SHIPPED)
        }
    assert f"{SHIPPED}/{ABI}.txt" in ours
    for module in listed_modules(ROOT):
        assert [name for name in ours if name.startswith(SHIPPED) and f"{module.replace('.', '/')}." in name]


def test_an_installed_wheel_says_what_it_is(installed: Installed) -> None:
    said = installed.ask("--version")
    assert f"law {installed.kind}" in said
    assert ("mypyc" if installed.kind == "compiled" else "not compiled for") in said
    assert "law pure" in installed.ask("--version", **{PURE: "1"})


def test_an_installed_wheel_flies(installed: Installed) -> None:
    told = installed.ask("up", "rhombus", "--seconds", "12", "--json", "--runs", installed.folder / "runs")
    assert json.loads(told.splitlines()[-1])["ok"]
    for log in ("drone-1.log", "drone-4.log", "world.log"):
        text = next((installed.folder / "runs").rglob(log)).read_text(encoding="utf-8")
        assert f"law {installed.kind}" in text


def test_an_edited_installation_runs_what_was_edited(installed: Installed) -> None:
    source = installed.packages / f"{listed_modules(ROOT)[0].replace('.', '/')}.py"
    before = source.read_text(encoding="utf-8")
    source.write_text(before + "\n# edited\n", encoding="utf-8")
    try:
        assert "law pure" in installed.ask("--version")
    finally:
        source.write_text(before, encoding="utf-8")
    assert f"law {installed.kind}" in installed.ask("--version")
