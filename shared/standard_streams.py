"""Standard input, output and error as every process expects them: open, and able to say everything."""

import io
import os
import sys


def settle_streams() -> None:
    """Opens those that are closed to nowhere, and escapes what their encoding has no characters for.

    Were they left closed, the next file or socket would take their numbers, and what is said would go into it.
    To be called before anything else is opened.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115  to stay open
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def settle_output() -> OSError | None:
    """Brings what has been printed to its reader; from a reader that is gone it turns away.

    Returns:
        Why not everything was read, None if it was.
    """
    problem = None
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            problem = error
            # What is still buffered would fail once more when the interpreter exits, with its code 120.
            with open(os.devnull, "wb") as nowhere:
                os.dup2(nowhere.fileno(), stream.fileno())
    return problem
