"""The boundary of every command: what nobody has foreseen ends in one line and a log, never in a traceback."""

import os
import platform
import shlex
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence

from shared.errors import SwarmTouchError
from shared.plain_text import plain
from shared.process import EXIT_FAILED, explain
from shared.standard_streams import settle_output, settle_streams

EXIT_INTERRUPTED = 128 + signal.SIGINT
EXIT_UNREAD = 128 + signal.SIGPIPE
"""As a shell reports whom a signal has ended."""


def contain(program: str, argv: Sequence[str], act: Callable[[], int]) -> int:
    """Runs a command.

    Args:
        program: Its name for messages.
        argv: Its arguments, for the log.
        act: Does it and returns the exit code.

    Returns:
        That code, or 2 for a configuration that is refused, 1 for any other failure, 130 after Ctrl-C, 141 if
        nobody reads standard output any more.
    """
    settle_streams()
    try:
        code = act()
    except SwarmTouchError as error:
        code = explain(program, error)
    except KeyboardInterrupt:
        print(f"{program}: interrupted", file=sys.stderr)
        code = EXIT_INTERRUPTED
    except BrokenPipeError:
        code = EXIT_UNREAD
    except SystemExit:  # argparse has said why
        settle_output()
        raise
    except Exception as error:  # noqa: BLE001  it is the boundary
        code = EXIT_FAILED
        if settle_output() is not None:
            print(f"{program}: standard output: {_reason(error)}", file=sys.stderr)
        elif isinstance(error, OSError) and error.filename is not None:
            print(f"{program}: {_reason(error)}", file=sys.stderr)
        else:
            print(f"{program}: {_reason(error)}; {_keep(argv, error)}", file=sys.stderr)
    problem = settle_output()
    if problem is None or code:
        return code
    if isinstance(problem, BrokenPipeError):
        return EXIT_UNREAD
    print(f"{program}: standard output: {_reason(problem)}", file=sys.stderr)
    return EXIT_FAILED


def _reason(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        where = f"{error.filename}: " if error.filename is not None else ""
        return plain(f"{where}{error.strerror}")
    return plain(f"{type(error).__name__}: {error}")


def _keep(argv: Sequence[str], error: Exception) -> str:
    """Writes down what a developer needs; says where that is."""
    trace = "".join(traceback.format_exception(error))
    report = f"{shlex.join(argv)}\nPython {platform.python_version()}, {platform.platform()}\n\n{trace}"
    try:
        handle, path = tempfile.mkstemp(prefix="swarmtouch-", suffix=".log")
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write(report)
    except OSError:
        return f"no log can be written, so here it is:\n{report}"
    return f"what led to it is in {path}"
