"""What every process of the swarm does alike: end on signals, log, share its health, die with its launcher."""

import argparse
import contextlib
import ctypes
import logging
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable

from shared.clock import NS_PER_S, Clock
from shared.codec import encode
from shared.compiled import form
from shared.errors import ConfigError, SwarmTouchError
from shared.messages import ProcessStatus
from shared.overrides import split_overrides
from shared.plain_text import plain
from shared.standard_streams import settle_streams
from shared.topics import STATUS
from shared.transport import Bus
from shared.watchdog import feed_watchdog

LAUNCHER_PID = "SWARMTOUCH_LAUNCHER_PID"
"""Environment variable by which a launcher asks its children to die with it."""

SCENARIO = "SWARMTOUCH_SCENARIO"
OVERRIDES = "SWARMTOUCH_SET"
"""Environment variables that stand for `--scenario` and `--set`."""

EXIT_FAILED = 1
EXIT_REFUSED = 2

_PR_SET_PDEATHSIG = 1
_M_ARENA_MAX = -8
_SWITCH_INTERVAL_S = 0.0005
_STATUS_PERIOD_NS = NS_PER_S
_LONGEST_LINE = 4000

_log = logging.getLogger("process")


def prepare_process(name: str, *, verbose: bool = False) -> threading.Event:
    """Sets a process up: memory, logging to stderr, signals, GIL hand-over, death with the launcher.

    To be called before anything that starts threads, as a bus does.

    Args:
        name: Name for its log lines.
        verbose: Whether to log debugging details.

    Returns:
        An event that SIGTERM, SIGINT or SIGHUP (the terminal is gone; not with `nohup`) sets: the loop ends.
    """
    settle_streams()
    _share_one_arena()
    line = f"%(asctime)s.%(msecs)03d {name} %(levelname)s %(name)s: %(message)s"
    handler = logging.StreamHandler()
    handler.setFormatter(_OneLine(line, datefmt="%H:%M:%S"))
    logging.basicConfig(level=logging.DEBUG if verbose else logging.INFO, handlers=[handler])
    # The default of 5 ms would let a busy thread delay every received sample by as much.
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    stopping = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        if number is not signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: stopping.set())
    launcher = os.environ.get(LAUNCHER_PID)
    if launcher:
        _die_with(int(launcher))
    return stopping


class _OneLine(logging.Formatter):
    """Writes each message on one line, whatever foreign text is in it; tracebacks follow as they are."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802  the base class's name
        record.message = plain(record.message, _LONGEST_LINE)
        return super().formatMessage(record)


def add_process_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares what every process of a swarm takes: `--scenario`, `--set` (repeatable) and `-v`.

    Containers and services say the first two in their environment; what the command line sets comes later and
    wins.
    """
    scenario = os.environ.get(SCENARIO)
    parser.add_argument(
        "--scenario",
        required=scenario is None,
        default=scenario,
        help=f"TOML file, or the name of one that ships; ${SCENARIO} if absent",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=split_overrides(os.environ.get(OVERRIDES, "")),
        metavar="KEY=VALUE",
        help=f"override a key; also those in ${OVERRIDES}, with spaces between, but in quotes and brackets",
    )
    parser.add_argument("-v", "--verbose", action="store_true", help="log debugging details")


def explain(program: str, error: SwarmTouchError) -> int:
    """Says on stderr why a process cannot run, and returns its exit code.

    Returns:
        2 if the configuration is refused (starting again will not help), else 1.
    """
    for reason in error.reasons if isinstance(error, ConfigError) else [error]:
        print(f"{program}: {plain(reason, _LONGEST_LINE)}", file=sys.stderr)
    return EXIT_REFUSED if isinstance(error, ConfigError) else EXIT_FAILED


def tell_form() -> str:
    """Logs, and returns, the form in which this process runs the law; says why if a compiled one is no good."""
    used = form()
    if used.refused:
        _log.warning("law %s: %s", used, used.reason)
    else:
        _log.info("law %s", used)
    return str(used)


class ResourceMeter:
    """Measures the CPU and memory use of this process."""

    def __init__(self) -> None:
        self._cpu = time.process_time()
        self._wall = time.monotonic()

    def read(self) -> tuple[float, float]:
        """Returns the fraction of one core used since the last call, and the resident memory in MB."""
        cpu, wall = time.process_time(), time.monotonic()
        fraction = (cpu - self._cpu) / max(wall - self._wall, 1e-6)
        self._cpu, self._wall = cpu, wall
        return fraction, _resident_mb()


class StatusReporter:
    """Publishes a `ProcessStatus` once a second, and whenever it is told to; the watchdog hears of it, too.

    Args:
        bus: Where to publish.
        role: Role of this process.
        number: Number within the role.
        clock: The process's clock.
        law: Form of the law that this process runs, empty if it runs none.
    """

    def __init__(self, bus: Bus, role: str, number: int, clock: Clock, law: str = "") -> None:
        self._publish = bus.publisher(STATUS, role=role, id=number)
        self._role, self._number, self._clock, self._law = role, number, clock, law
        self._epoch = clock()
        self._seq = 0
        self._due_ns = self._last_ns = self._epoch
        self._steps = 0
        self._meter = ResourceMeter()
        self._audit = bus.audit
        bus.announce(role, number)

    def tick(
        self,
        steps: int,
        state: str = "running",
        rejected: dict[str, int] | None = None,
        metrics: Callable[[], dict[str, float]] = dict,
        *,
        force: bool = False,
    ) -> None:
        """Publishes if a second has passed.

        Args:
            steps: Loop steps since the start.
            state: One word on how it goes.
            rejected: Dropped messages by reason since the start.
            metrics: Called for further numbers, only when it is time.
            force: Publish now.
        """
        now = self._clock()
        if now < self._due_ns and not force:
            return
        self._due_ns = now + _STATUS_PERIOD_NS
        cpu, rss_mb = self._meter.read()
        elapsed = max((now - self._last_ns) / NS_PER_S, 1e-6)
        status = ProcessStatus(
            epoch=self._epoch,
            seq=self._seq,
            stamp_ns=now,
            role=self._role,
            id=self._number,
            pid=os.getpid(),
            host=socket.gethostname(),
            state=state,
            form=self._law,
            rate_hz=(steps - self._steps) / elapsed,
            cpu=cpu,
            rss_mb=rss_mb,
            rejected=dict(rejected or {}),
            metrics={**metrics(), **self._audit()},
        )
        self._publish(encode(status))
        feed_watchdog()
        self._seq += 1
        self._last_ns, self._steps = now, steps


def _share_one_arena() -> None:
    """Has all threads allocate from one arena of the C library.

    With glibc each of Zenoh's threads has its own, and what is free in one is of no use to another: the process
    grows with every link that goes and comes back on other threads, for hours, though nothing leaks.
    """
    if sys.platform == "linux":
        with contextlib.suppress(AttributeError):  # not glibc
            ctypes.CDLL(None).mallopt(_M_ARENA_MAX, 1)


def _die_with(launcher: int) -> None:
    """Makes the kernel kill this process when the launcher dies, however that happens."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    else:
        threading.Thread(target=_watch_parent, args=(launcher,), daemon=True).start()
    if os.getppid() != launcher:  # it died before the request took effect
        os._exit(1)


def _watch_parent(launcher: int) -> None:
    while os.getppid() == launcher:
        time.sleep(0.5)
    os._exit(1)


def _resident_mb() -> float:
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            pages = int(file.read().split()[1])
    except OSError:
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
