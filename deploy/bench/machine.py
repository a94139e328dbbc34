"""What the numbers depend on: the machine, the versions, and how busy others kept it meanwhile."""

import os
import platform
import resource
from importlib.metadata import version
from pathlib import Path

from shared.compiled import form

SHORTEST_S = 0.1
"""The kernel counts in hundredths of a second: within less time one of them would look like a busy core, s."""

_STAT = Path("/proc/stat")
_IDLE = (3, 4)
_GUEST = 8


class Conditions:
    """The conditions of a measurement, from the moment it is made."""

    def __init__(self) -> None:
        self._seconds, self._busy, self._own = _uptime(), _busy_s(), _own_s()

    def others_cores(self) -> float | None:
        """Returns how many cores processes other than ours have kept busy since; None if that cannot be told.

        Ours are this process and those of its children that have ended.
        """
        seconds = _uptime() - self._seconds
        if self._busy is None or (busy := _busy_s()) is None or seconds < SHORTEST_S:
            return None
        others = busy - self._busy - (_own_s() - self._own)
        return max(0.0, others) / seconds

    def facts(self) -> dict[str, str | float | None]:
        """Returns what every line of JSON says beside its numbers."""
        return {"form": str(form()), "others_cores": self.others_cores()}

    def text(self) -> str:
        """Returns cores, system, versions, the form of the law and the load of others, in one line."""
        others = self.others_cores()
        return (
            f"{os.cpu_count()} cores, {platform.system()} {platform.machine()},"
            f" Python {platform.python_version()}, law {form()},"
            f" Zenoh {version('eclipse-zenoh')}, NumPy {version('numpy')}"
            + ("" if others is None else f"; other processes used {others:.2f} cores meanwhile")
        )


def _uptime() -> float:
    return os.times().elapsed


def _busy_s() -> float | None:
    """Returns the processor time of the whole machine, s; what a hypervisor took away counts as busy."""
    try:
        fields = [int(field) for field in _STAT.read_text(encoding="ascii").split("\n", 1)[0].split()[1:]]
    except OSError:
        return None
    busy = sum(ticks for index, ticks in enumerate(fields[:_GUEST]) if index not in _IDLE)
    return busy / os.sysconf("SC_CLK_TCK")


def _own_s() -> float:
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)
