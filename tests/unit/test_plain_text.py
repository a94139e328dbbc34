"""Foreign text before people: nothing of it acts, in a table, on a console or in a log."""

import io
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.table import Table

from deploy.terminal.console import PlainConsole
from shared.errors import ConfigError, DeviceError
from shared.plain_text import LONGEST, plain
from shared.process import EXIT_FAILED, EXIT_REFUSED, explain

NASTY = "\x1b]0;mine\x07[/red][bold]x[/x] :smiley: \x9b31m\u202e\u2028\ud800\r\n"


@given(st.text() | st.text(alphabet=NASTY))
def test_what_is_shown_is_printable_and_of_bounded_length(text: str) -> None:
    shown = plain(text)
    assert shown.isprintable()
    assert len(shown) <= 10 * LONGEST + 3
    shown.encode()


@given(st.text(alphabet=st.characters(exclude_categories=("C", "Z")), max_size=LONGEST))
def test_what_is_harmless_is_shown_as_it_is(text: str) -> None:
    assert plain(text) == text


def test_escapes_are_seen_and_length_is_cut() -> None:
    assert plain("a\x1b[31m\n\u202e") == r"a\x1b[31m\n\u202e"
    assert plain("x" * 500) == "x" * LONGEST + "..."
    assert plain("\x1b" * 10, 9) == r"\x1b\x1b...", "cut as it is shown"
    assert plain("123456789", 9) == "123456789"


def test_to_a_console_every_string_is_text() -> None:
    out = io.StringIO()
    table = Table(title=NASTY, caption=NASTY)
    table.add_column(NASTY)
    table.add_row(NASTY)
    for each in (table, NASTY, f"one{NASTY}two"):
        PlainConsole(file=out, width=120, force_terminal=False).print(each)
    assert out.getvalue().replace("\n", "").isprintable()
    assert "[bold]x[/x] :smiley:" in out.getvalue()


def test_a_reason_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert explain("agents", ConfigError(NASTY, "fence")) == EXIT_REFUSED
    first, second = capsys.readouterr().err.splitlines()
    assert first.isprintable()
    assert second == "agents: fence"


def test_an_error_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert explain("agents", DeviceError(NASTY)) == EXIT_FAILED
    said = capsys.readouterr().err
    assert said.endswith("\n")
    assert said[:-1].isprintable()


def test_a_log_has_one_line_per_message_and_nothing_else_in_it() -> None:
    program = (
        "import logging; from shared.process import prepare_process;"
        f"prepare_process('test'); logging.getLogger('x').warning('dropped %s', {NASTY!r})"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    (line,) = run.stderr.splitlines()
    assert line.isprintable()
    assert r"\x1b]0;mine" in line
