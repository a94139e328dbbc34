"""The command line: it explains itself, and refuses before anything starts."""

import importlib
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from deploy.cli import COMMANDS, main
from shared.compiled import form
from shared.config import SCENARIOS


def help_of(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    with pytest.raises(SystemExit) as ended:
        main([*arguments, "--help"])
    assert ended.value.code == 0
    return capsys.readouterr().out


def test_the_help_lists_every_command_and_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    text = help_of(capsys)
    assert all(name in text for name in COMMANDS)
    assert "example: swarmtouch up" in text


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself_with_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = help_of(capsys, name)
    assert f"example: swarmtouch {name}" in text
    assert importlib.import_module(f"deploy.cli.{name}").DESCRIPTION.split(maxsplit=1)[0] in text


def test_help_loads_neither_the_bus_nor_numpy() -> None:
    code = (
        "import sys, deploy.cli\n"
        "try: deploy.cli.main(['--help'])\n"
        "except SystemExit: pass\n"
        "sys.exit(bool({'zenoh', 'numpy', 'rich'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL, check=False).returncode == 0


def test_the_version_says_which_form_of_the_law_flies(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out.startswith(f"swarmtouch {version('swarmtouch')}, law {form()} (")


def test_scenarios_lists_what_ships_with_its_first_comment(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenarios"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(maxsplit=1)[0] for line in lines] == sorted(p.stem for p in SCENARIOS.glob("*.toml"))
    assert all(len(line.split(maxsplit=1)) == 2 for line in lines)


def refusal(tmp_path: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Expects exit code 2, one line on stderr, and that no run was begun."""
    assert main(["up", *arguments, "--runs", str(tmp_path / "runs")]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert not (tmp_path / "runs").exists()
    (line,) = output.err.splitlines()
    return line


def test_an_unknown_key_is_refused_with_file_key_and_hint(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[impedance]\nstifness = 21.0\n")
    line = refusal(tmp_path, capsys, str(file))
    assert str(file) in line
    assert "impedance" in line
    assert "did you mean 'stiffness'" in line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["rhombux"], ["rhombux", "did you mean 'rhombus'"]),
        (
            ["rhombus", "--set", "impedance.stiffness=-1"],
            ["stiffness must be > 0", "impedance", "rhombus.toml"],
        ),
        (["rhombus", "--set", "formation.n"], ["formation.n", "key=value"]),
        (["rhombus", "--set", "formation.spacing=0.1"], ["rhombus", "formation", "safety_distance"]),
        (["rhombus", "--hand", "telepathy:now"], ["telepathy", "scripted:"]),
        (["rhombus", "--hand", "recording:/nowhere/at/all"], ["/nowhere/at/all"]),
    ],
)
def test_what_cannot_fly_is_refused_in_one_line(
    arguments: list[str], words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = refusal(tmp_path, capsys, *arguments)
    assert all(word in line for word in words), line


@pytest.mark.parametrize("arguments", [[], ["fly"], ["up"], ["up", "rhombus", "--seconds", "0"]])
def test_wrong_usage_is_refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert "usage: swarmtouch" in capsys.readouterr().err
