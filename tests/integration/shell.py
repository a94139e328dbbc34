"""A real shell with job control on a terminal of its own, as somebody who flies has it."""

import os
import pty
import select
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

LIMIT_S = 60.0
PROMPT = "ready> "
BASH = Path("/bin/bash")

CTRL_C, CTRL_Z = "\x03", "\x1a"


class Shell:
    """What is typed, and what can be read.

    Args:
        master: The other end of the shell's terminal.
        pid: The shell.

    Attributes:
        text: Everything that has appeared on the terminal.
    """

    def __init__(self, master: int, pid: int) -> None:
        self.pid = pid
        self.text = ""
        self._master = master
        self._seen = 0

    def type(self, keys: str) -> None:
        """Types keys."""
        os.write(self._master, keys.encode())

    def until(self, words: str) -> str:
        """Reads until words appear that have not been waited for yet; returns what came before them."""
        deadline = time.monotonic() + LIMIT_S
        while words not in self.text[self._seen :]:
            left = deadline - time.monotonic()
            assert left > 0, f"no {words!r} in {self.text[self._seen :]!r}"
            assert self._read(left), f"the terminal has ended without {words!r}: {self.text!r}"
        end = self.text.index(words, self._seen)
        before, self._seen = self.text[self._seen : end], end + len(words)
        return before

    def hang_up(self) -> None:
        """Closes the window."""
        os.close(self._master)
        self._master = -1

    def _read(self, timeout_s: float) -> bool:
        ready, _, _ = select.select([self._master], [], [], timeout_s)
        data = b""
        if ready:
            with suppress(OSError):
                data = os.read(self._master, 65536)
        self.text += data.decode(errors="replace")
        return bool(data) or not ready


@contextmanager
def shell(folder: Path) -> Iterator[Shell]:
    """Opens a shell in a folder; afterwards it is gone, and with it whatever it has started that still runs."""
    pid, master = pty.fork()
    if pid == 0:
        os.chdir(folder)
        environment = {
            **os.environ,
            "PS1": PROMPT,
            "TERM": "xterm",
            "PATH": f"{Path(sys.executable).parent}:/bin",
        }
        os.execve(BASH, ["bash", "--norc", "--noprofile", "--noediting", "-i"], environment)  # noqa: S606  it is the shell
    opened = Shell(master, pid)
    try:
        opened.until(PROMPT)
        yield opened
    finally:
        # A job in the background would outlive its shell, and fly on beside the next test.
        for member in (*_session(pid), pid):
            with suppress(ProcessLookupError):
                os.kill(member, signal.SIGKILL)
        os.waitpid(pid, 0)
        if opened._master >= 0:
            opened.hang_up()


def _session(leader: int) -> Iterator[int]:
    """Yields the processes of a session, by Linux's /proc; flights end their own."""
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(ProcessLookupError):
            if os.getsid(int(folder.name)) == leader:
                yield int(folder.name)
