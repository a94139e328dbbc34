"""What a process has used so far, as Linux counts it: no process has to measure itself."""

import os
from pathlib import Path

from attrs import frozen

_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
_MB_PER_PAGE = os.sysconf("SC_PAGE_SIZE") / 1e6


@frozen(kw_only=True)
class Usage:
    """Counts since the start of a process, or their growth over a time.

    Attributes:
        cpu_s: Processor time of all threads, s.
        wakeups: How often a thread of it went to sleep, and so was woken up again.
        rss_mb: Resident memory at the end, MB.
    """

    cpu_s: float
    wakeups: int
    rss_mb: float

    def since(self, earlier: "Usage") -> "Usage":
        """Returns the growth since an earlier reading."""
        return Usage(
            cpu_s=self.cpu_s - earlier.cpu_s, wakeups=self.wakeups - earlier.wakeups, rss_mb=self.rss_mb
        )


def read_usage(pid: int) -> Usage:
    """Reads the counters of a live process from /proc.

    Raises:
        OSError: It has ended, or this is not Linux.
    """
    process = Path(f"/proc/{pid}")
    # The name, in brackets, may contain anything; what is counted comes after it.
    fields = (process / "stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    user, system, pages = int(fields[11]), int(fields[12]), int(fields[21])
    return Usage(
        cpu_s=(user + system) / _TICKS_PER_S,
        wakeups=sum(_wakeups(thread / "status") for thread in (process / "task").iterdir()),
        rss_mb=pages * _MB_PER_PAGE,
    )


def _wakeups(status: Path) -> int:
    try:
        lines = status.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:  # the thread has ended since its name was read
        return 0
    return next((int(line.split()[1]) for line in lines if line.startswith("voluntary_ctxt_switches")), 0)
