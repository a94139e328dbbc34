"""The firmware's parser and player under libFuzzer, against a second implementation (`fuzz/oracle.h`)."""

import os
import subprocess
from pathlib import Path

import pytest

from tests.chip.simulated_chip import ROOT

FUZZER = ROOT / "build" / "fuzz" / "fuzz_glove"
CORPUS = Path(__file__).parent / "fuzz" / "corpus"
SECONDS = int(os.environ.get("FUZZ_SECONDS", "5"))

pytestmark = [pytest.mark.chip, pytest.mark.parallel, pytest.mark.timeout(SECONDS + 120)]


def fuzz(folder: Path, *arguments: str) -> str:
    """Runs the fuzzer; what it finds, it leaves in `folder`."""
    run = subprocess.run(
        [FUZZER, f"-artifact_prefix={folder}/", "-print_final_stats=1", *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-4000:]
    return run.stderr


def test_the_corpus_passes(built: str, tmp_path: Path) -> None:  # noqa: ARG001
    kept = sorted(CORPUS.iterdir())
    assert len(kept) > 20
    fuzz(tmp_path, *map(str, kept))


def test_nothing_new_is_found(built: str, tmp_path: Path) -> None:  # noqa: ARG001
    grown = tmp_path / "grown"
    grown.mkdir()
    said = fuzz(tmp_path, f"-max_total_time={SECONDS}", str(grown), str(CORPUS))
    runs = next(line for line in said.splitlines() if "number_of_executed_units" in line)
    assert int(runs.split()[-1]) > 1000
    print(runs)
