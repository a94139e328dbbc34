"""docs/dependencies.md lists what is locked: every package that users install, its version, what wants it."""

import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from deploy.net import FOLDER

ROOT = Path(__file__).parents[2]
NAME = "swarmtouch"
ROW = re.compile(r"^\| ([a-z0-9-]+) \| (\d[\w., ]*) \| ([^|]+) \| ([^|]+) \|$", re.MULTILINE)

Package = dict[str, Any]


def locked() -> dict[str, list[Package]]:
    tree = tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))
    packages: dict[str, list[Package]] = {}
    for package in tree["package"]:
        packages.setdefault(package["name"], []).append(package)
    return packages


def wants(packages: Iterable[Package]) -> set[str]:
    """Returns what these packages need, extras included."""
    wanted = [row for package in packages for row in package.get("dependencies", ())]
    for package in packages:
        wanted += [row for rows in package.get("optional-dependencies", {}).values() for row in rows]
    return {row["name"] for row in wanted}


def test_every_installed_package_is_listed_with_its_version_and_what_wants_it() -> None:
    packages = locked()
    direct = wants(packages[NAME])
    installed, waiting = set[str](), set(direct)
    while waiting:
        name = waiting.pop()
        installed.add(name)
        waiting |= wants(packages[name]) - installed
    text = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
    listed = {name: (versions, licence, why) for name, versions, licence, why in ROW.findall(text)}
    assert set(listed) == installed
    for name, (versions, licence, why) in listed.items():
        assert versions.split(", ") == sorted(package["version"] for package in packages[name]), name
        assert licence.strip()
        wanting = sorted(other for other in installed if name in wants(packages[other]))
        assert why.startswith("through ") is (name not in direct)
        if name not in direct:
            assert why == f"through {', '.join(wanting)}", name


def test_every_locked_file_has_a_hash_and_comes_from_the_index() -> None:
    for name, packages in locked().items():
        for package in packages:
            if name != NAME:
                files = [*package.get("wheels", ()), *([package["sdist"]] if "sdist" in package else [])]
                assert files, name
                assert all(file["hash"].startswith("sha256:") for file in files), name
                assert package["source"] == {"registry": "https://pypi.org/simple"}, name


def test_the_image_is_built_without_what_only_developers_need_and_without_keys() -> None:
    dockerfile = (ROOT / "deploy" / "docker" / "Dockerfile").read_text(encoding="utf-8")
    assert dockerfile.count("sync --frozen --no-dev") == dockerfile.count(" sync ") > 0
    *_, last_stage = dockerfile.split("\nFROM ")
    assert "USER swarmtouch" in last_stage
    # Everything stays outside but what is named; keys lie in none of these folders.
    first, *named = (
        line
        for line in (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
        if line and not line.startswith("#")
    )
    assert first == "*"
    kept = {line.removeprefix("!") for line in named}
    assert {"agents", "shared", "uv.lock"} <= kept
    assert kept.isdisjoint({FOLDER, "runs", "tests", ".git", "."})
