"""The real mypyc and C compiler, on a small house: the same numbers, tracebacks, and two builds at once."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from shared.compiled import BUILT, PURE

pytestmark = [pytest.mark.timeout(600), pytest.mark.packaging]

ROOT = Path(__file__).resolve().parents[2]
COMPILER = ROOT / ".bootstrap/compiler/bin/python"
SOURCES = {
    "law/__init__.py": "import shared\n",
    "law/limits.py": "from typing import Final\nGAIN: Final = 0.1\n",
    "law/point.py": """
from typing import final

@final
class Point:
    def __init__(self, x: float, y: float) -> None:
        self.x, self.y = x, y
""",
    "law/step.py": """
import math
from law.limits import GAIN
from law.point import Point

def step(point: Point, goal: Point, dt: float) -> Point:
    return Point(point.x + GAIN * dt * (goal.x - point.x), math.sqrt(point.y * point.y + goal.y * goal.x))

def follow(ticks: int) -> list[float]:
    point, goal = Point(0.0, 1.0), Point(0.3, 0.7)
    for tick in range(ticks):
        point = step(point, Point(goal.x + 1e-3 * tick, goal.y), 1.0 / 60.0)
    return [point.x, point.y]

def fail(divisor: float) -> float:
    return 1.0 / divisor
""",
}
MODULES = ("law.point", "law.step")
BUILD = """
import sys
from pathlib import Path
from deploy.compile.build import compile_modules
root = Path(sys.argv[1])
compile_modules(root, sys.argv[3:], root / sys.argv[2], say=print)
"""

LOGGED = """
import logging
try:
    law.step.fail(0.0)
except ZeroDivisionError:
    logging.exception("a step failed")
"""


def build(root: Path) -> subprocess.Popen[str]:
    command = [str(COMPILER), "-c", BUILD, str(root), BUILT, *MODULES]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compiled by two builds at the same time, as when somebody runs `make demo` in two terminals."""
    if not COMPILER.exists():
        pytest.skip("no environment for compiling; make compile")
    root = tmp_path_factory.mktemp("house")
    for path, text in SOURCES.items():
        (root / path).parent.mkdir(exist_ok=True)
        (root / path).write_text(text, encoding="utf-8")
    (root / "shared").mkdir()
    for name in ("__init__.py", "compiled.py"):
        shutil.copy(ROOT / "shared" / name, root / "shared" / name)
    for started in (build(root), build(root)):
        told, _ = started.communicate()
        assert started.returncode == 0, told
    return root


def run(house: Path, code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs code that imports the house."""
    own = {key: value for key, value in os.environ.items() if key != PURE} | environment
    place = f"import sys; sys.path.insert(0, {str(house)!r})\n"
    imports = "from shared.compiled import form; import law.step\n"
    command = [sys.executable, "-P", "-B", "-c", place + imports + code]
    return subprocess.run(command, check=False, capture_output=True, text=True, env=own)


def test_both_forms_compute_the_same_to_the_last_bit(house: Path) -> None:
    ask = "print(form(), *[x.hex() for x in law.step.follow(1000)])"
    compiled, pure = run(house, ask).stdout.split(), run(house, ask, **{PURE: "1"}).stdout.split()
    assert (compiled[0], pure[0]) == ("compiled", "pure")
    assert compiled[2:] == pure[1:]
    assert len(pure) == 3


def test_a_traceback_names_file_line_and_function_in_both_forms(house: Path) -> None:
    line = SOURCES["law/step.py"].splitlines().index("    return 1.0 / divisor") + 1
    for pure in ("0", "1"):
        uncaught = run(house, "law.step.fail(0.0)", **{PURE: pure}).stderr
        assert re.search(rf'File ".*law/step\.py", line {line}, in fail', uncaught), uncaught
        assert "ZeroDivisionError" in uncaught
        # As in a log: Python's own printer also finds the line, by its name below the folder of the packages.
        logged = run(house, LOGGED, **{PURE: pure}).stderr
        assert re.search(rf"line {line}, in fail\n +return 1\.0 / divisor\n", logged), logged


def test_a_constant_of_a_module_that_is_not_compiled_is_never_an_old_one(house: Path) -> None:
    """The compiler has copied it into its code; so that code is no longer used."""
    limits = house / "law/limits.py"
    before = limits.read_text(encoding="utf-8")
    ask = "print(form().refused, law.step.follow(10)[0])"
    refused, value = run(house, ask).stdout.split()
    limits.write_text(before.replace("0.1", "0.2"), encoding="utf-8")
    edited_refused, edited_value = run(house, ask).stdout.split()
    limits.write_text(before, encoding="utf-8")
    assert (refused, edited_refused) == ("False", "True")
    assert float(edited_value) > 1.5 * float(value)
