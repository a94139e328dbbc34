"""The boundary of every command: closed, full, narrow and foreign terminals, and what nobody has foreseen."""

import errno
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import pytest

from deploy.cli.boundary import EXIT_INTERRUPTED, EXIT_UNREAD, contain
from shared.errors import ConfigError, DeviceError

SHORT = ["scenarios"]
TABLES = ["glove", "patterns", "paper"]


def swarmtouch(*words: str, before: Callable[[], None] | None = None, **options: Any) -> tuple[int, str, str]:
    """Runs a command in a process of its own; `before` prepares that."""
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    command = [sys.executable, "-m", "deploy.cli", *words]
    with subprocess.Popen(command, text=True, preexec_fn=before, **streams) as process:  # noqa: PLW1509
        output, errors = process.communicate(timeout=60)
    return process.returncode, output or "", errors or ""


def closing(*descriptors: int) -> Callable[[], None]:
    def close() -> None:
        for descriptor in descriptors:
            os.close(descriptor)

    return close


@pytest.mark.parametrize("words", [SHORT, TABLES, ["--help"], ["sim", "rhombus", "--seconds", "0.1"]])
@pytest.mark.parametrize("closed", [(0,), (1,), (2,), (0, 1, 2)])
def test_closed_streams_change_nothing(words: list[str], closed: tuple[int, ...]) -> None:
    code, _, errors = swarmtouch(*words, before=closing(*closed))
    assert (code, errors) == (0, "")


def test_what_is_opened_never_gets_the_number_of_a_closed_stream(tmp_path: Path) -> None:
    table = tmp_path / "flight.csv"
    words = ["sim", "rhombus", "--seconds", "0.1", "--csv", str(table)]
    assert swarmtouch(*words, before=closing(1, 2))[0] == 0
    assert all(re.fullmatch(r"[-0-9.e+,]+", line) for line in table.read_text().splitlines()[1:])


@pytest.mark.parametrize("words", [SHORT, ["--help"], ["sim", "rhombus", "--seconds", "0.1"]])
def test_a_reader_that_is_gone_gets_no_traceback(words: list[str]) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    code, _, errors = swarmtouch(*words, stdout=writing)
    os.close(writing)
    assert errors == ""
    assert code in (0, EXIT_UNREAD)


@pytest.mark.parametrize("words", [SHORT, ["sim", "rhombus", "--seconds", "0.1"]])
def test_a_full_disk_behind_standard_output_is_named(words: list[str]) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        code, _, errors = swarmtouch(*words, stdout=full, env=environment)
    assert (code, errors) == (1, "swarmtouch: standard output: No space left on device\n")


@pytest.mark.parametrize("columns", ["0", "1", "20", "-1", "x"])
def test_a_narrow_terminal_loses_nothing(columns: str) -> None:
    usual = swarmtouch(*TABLES, env={**os.environ, "COLUMNS": "80"})
    assert swarmtouch(*TABLES, env={**os.environ, "COLUMNS": columns}) == usual
    assert usual[0] == 0
    assert "1@250" in usual[1] or "EI" in usual[1]


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-16"])
def test_what_an_encoding_cannot_say_is_escaped(encoding: str) -> None:
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    command = [sys.executable, "-m", "deploy.cli", "up", "sch\u00f6n\u2603"]
    done = subprocess.run(command, env=environment, capture_output=True, check=False)
    said = done.stderr.decode(encoding)
    assert done.returncode == 2
    assert said.isascii() or "sch\u00f6n" in said
    assert "no such scenario file" in said


def test_without_any_environment_a_flight_is_simulated_and_drawn(tmp_path: Path) -> None:
    words = ["sim", "rhombus", "--seconds", "0.1", "--plot", str(tmp_path / "flight.svg")]
    code, _, errors = swarmtouch(*words, env={}, cwd=Path(__file__).parents[2])
    assert (code, (tmp_path / "flight.svg").exists()) == (0, True), errors


def test_ctrl_c_is_no_traceback() -> None:
    words = ["sim", "grid", "--set", "formation.n=300", "--seconds", "3600"]
    command = [sys.executable, "-c", CTRL_C, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (EXIT_INTERRUPTED, "swarmtouch: interrupted\n")


CTRL_C = f"""
import signal, sys, time, deploy.cli, deploy.lockstep.simulate as simulate
def interrupted(*_):
    signal.raise_signal({signal.SIGINT.value})
    while True:  # Python may take a moment to see it.
        time.sleep(0.01)
simulate.relayed = interrupted
sys.exit(deploy.cli.main())
"""


def raising(error: BaseException) -> Callable[[], int]:
    def act() -> NoReturn:
        raise error

    return act


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (ConfigError("x.toml: no"), 2, "swarmtouch: x.toml: no"),
        (DeviceError("gone"), 1, "swarmtouch: gone"),
        (KeyboardInterrupt(), EXIT_INTERRUPTED, "swarmtouch: interrupted"),
        (OSError(errno.EACCES, "Permission denied", "/root/x"), 1, "swarmtouch: /root/x: Permission denied"),
    ],
)
def test_what_is_foreseen_is_one_line(
    error: BaseException, code: int, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert contain("swarmtouch", [], raising(error)) == code
    assert capsys.readouterr().err == f"{line}\n"


def test_what_is_not_foreseen_is_one_line_and_a_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert contain("swarmtouch", ["up", "a b", "\udcff"], raising(ValueError("two\nlines"))) == 1
    (line,) = capsys.readouterr().err.splitlines()
    (log,) = tmp_path.iterdir()
    assert line == rf"swarmtouch: ValueError: two\nlines; what led to it is in {log}"
    text = log.read_text(encoding="utf-8")
    assert text.startswith("up 'a b' ")
    assert "Traceback" in text
    assert "raise error" in text


def test_without_a_place_for_the_log_nothing_is_lost(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tempfile.tempdir", "/proc/nowhere")
    assert contain("swarmtouch", ["up"], raising(ValueError("x"))) == 1
    assert "Traceback" in capsys.readouterr().err
