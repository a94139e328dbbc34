"""Serial devices, the clock, and the processor."""

import grp
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from serial.tools import list_ports

from deploy.doctor.finding import Finding, bad, good, warning

CORES_PER_AGENT = 0.12
"""What an agent costs at 60 Hz on two cores of 2.6 GHz (docs/performance.md)."""
COARSE_MS = 3.0
_NAPS, _NAP_S = 100, 0.002
_ALIGNED_MS = 1.0
_GOVERNOR = Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")


def check_serial() -> Iterator[Finding]:
    """Looks for serial devices and whether this user may open them."""
    devices = sorted(port.device for port in list_ports.comports() if port.hwid != "n/a")
    if not devices:
        yield good("serial devices", "none (a glove or a radio would show up here)")
    for device in devices:
        if os.access(device, os.R_OK | os.W_OK):
            yield good(f"serial {device}", "may be opened")
            continue
        group = _group(device)
        advice = f"sudo usermod -aG {group} $USER, then log in again"
        yield warning(f"serial {device}", f"belongs to the group {group}", advice)


def check_clock() -> Finding:
    """Looks how late naps of 2 ms end, and whether the wall clock runs as evenly as the monotonic one."""
    offset = time.time_ns() - time.monotonic_ns()
    late = []
    for _ in range(_NAPS):
        before = time.perf_counter()
        time.sleep(_NAP_S)
        late.append((time.perf_counter() - before - _NAP_S) * 1e3)
    drift_ms = abs(time.time_ns() - time.monotonic_ns() - offset) / 1e6
    late.sort()
    found = f"naps end {late[_NAPS // 2]:.2f} ms late (median), {late[-2]:.2f} ms (p99)"
    if drift_ms > _ALIGNED_MS:
        return warning(
            "clock",
            f"the wall clock jumped by {drift_ms:.1f} ms while we looked",
            "let NTP settle: only then are stamps of several machines comparable (no safety decision needs it)",
        )
    if late[-2] > COARSE_MS:
        return warning("clock", found, "the machine is busy or its timer is coarse: end what else runs")
    return good("clock", found)


def check_processor(drones: int) -> Iterator[Finding]:
    """Looks whether the processor is large and free enough for a swarm of so many drones.

    Args:
        drones: How many are to fly on this machine.
    """
    cores = len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1
    load = os.getloadavg()[0]
    needed = CORES_PER_AGENT * (drones + 1)
    found = f"{cores} cores, {load:.1f} busy; {drones} drones need about {needed:.1f}"
    if needed > cores:
        advice = "fly fewer drones, spread them over machines, or use swarmtouch sim"
        yield bad("processor", found, advice)
    elif needed + load > cores:
        yield warning("processor", found, "end what else runs, or expect steps to be late")
    else:
        yield good("processor", found)
    governor = _GOVERNOR.read_text(encoding="ascii").strip() if _GOVERNOR.is_file() else ""
    if governor == "powersave":
        yield warning("governor", governor, "sudo cpupower frequency-set -g performance, for steady timing")


def all_hardware(drones: int) -> Iterator[Finding]:
    """Yields every finding about hardware."""
    yield from check_serial()
    yield check_clock()
    yield from check_processor(drones)


def _group(device: str) -> str:
    try:
        return grp.getgrgid(Path(device).stat().st_gid).gr_name
    except (OSError, KeyError):
        return "dialout"
