"""Parsers of bytes under atheris, with coverage, `FUZZ_SECONDS` in all; a failure shows what was found."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz.parsers import CORPUS, PARSERS, Parser

WIRES = [parser for parser in PARSERS if parser.is_wire]
SECONDS = max(1, int(os.environ.get("FUZZ_SECONDS", "10")) // len(WIRES))
OPTIONS = ("-timeout=20", "-rss_limit_mb=2048", "-max_len=8192", "-verbosity=0", "-print_final_stats=1")

pytestmark = [pytest.mark.fuzz, pytest.mark.timeout(SECONDS + 120)]


@pytest.fixture(scope="module", autouse=True)
def _atheris() -> None:
    if importlib.util.find_spec("atheris") is None:
        say = pytest.fail if "CI" in os.environ else pytest.skip
        say("no atheris: .bootstrap/uv sync --frozen --inexact --group fuzz")


@pytest.mark.parametrize("parser", WIRES, ids=lambda parser: parser.name)
def test_nothing_new_is_found(parser: Parser, tmp_path: Path) -> None:
    good = tmp_path / "good"
    good.mkdir()
    for number, data in enumerate(parser.inputs()):
        (good / str(number)).write_bytes(data)
    run = subprocess.run(
        [
            *(sys.executable, "-m", "tests.fuzz", parser.name, f"-max_total_time={SECONDS}", *OPTIONS),
            *(f"-artifact_prefix={tmp_path}/", good),
        ],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    found = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    assert run.returncode == 0, f"{run.stdout}{run.stderr[-500:]}{found}: keep it in {CORPUS / parser.name}"
    runs = re.search(r"number_of_executed_units: (\d+)", run.stderr)
    assert runs is not None
    assert int(runs[1]) > len(parser.inputs())
    print(f"{parser.name}: {runs[1]} runs")
