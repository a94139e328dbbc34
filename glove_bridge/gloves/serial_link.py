"""A serial line to a glove that heals itself: one thread owns the port and the session on it."""

import logging
import queue
import secrets
import threading
import time
from collections.abc import Callable
from contextlib import suppress

import serial

from glove_bridge.gloves.base import Report
from glove_bridge.link_timing import LinkTiming
from glove_bridge.session import NOT_A_GLOVE, Session

Order = Callable[[Session, int], None]
"""What to ask the session for, and when, ns."""

TICK_S = 0.005
"""The thread looks at the session's deadlines at least this often; bytes and orders wake it at once."""

FIRST_REST_S, LONGEST_REST_S = 0.1, 0.5
"""Time between two attempts to open a port, doubled from the first to the longest."""

WRITE_S, CLOSE_S = 0.25, 1.0
"""How long a write may take before the port counts as dead, and how long closing waits for the thread."""

LONGEST_READ = 4096
MOST_BABBLE = 65_536
"""A port that says so much and is no glove is given a rest, or reading it would take all the time there is."""

_log = logging.getLogger("glove")


class SerialLink:
    """The line to one device; no call blocks, but `close` for at most `CLOSE_S`.

    Times in reports are those of `time.monotonic_ns`.

    Args:
        device: Name of the port, for example `/dev/ttyACM0`; it may appear later, vanish and come back.
        timing: How fast the line is.

    Attributes:
        session: The session on it, to be read only.
    """

    def __init__(self, device: str, timing: LinkTiming) -> None:
        self.session = Session(timing, secrets.randbits(16))
        self._device, self._timing = device, timing
        self._orders: queue.SimpleQueue[Order] = queue.SimpleQueue()
        self._reports: queue.SimpleQueue[Report] = queue.SimpleQueue()
        self._port: serial.Serial | None = None
        self._port_lock = threading.Lock()
        self._wake, self._closing = threading.Event(), threading.Event()
        self._told = ""
        self._thread = threading.Thread(target=self._run, name="glove-line", daemon=True)
        self._thread.start()

    @property
    def connected(self) -> bool:
        """Whether patterns can be felt."""
        return not self.session.fault

    def order(self, order: Order) -> None:
        """Has the session asked for something, by the thread that owns it."""
        self._orders.put(order)
        self._rouse()

    def reports(self) -> list[Report]:
        """Returns what has become of patterns since the last call, oldest first."""
        reports = []
        with suppress(queue.Empty):
            while True:
                reports.append(self._reports.get_nowait())
        return reports

    def close(self) -> None:
        """Stops every motor and releases the port; further calls do nothing."""
        self.order(Session.stop)
        self._closing.set()
        self._rouse()
        self._thread.join(CLOSE_S)

    def _rouse(self) -> None:
        self._wake.set()
        with self._port_lock:
            if self._port is not None:
                self._port.cancel_read()

    def _run(self) -> None:
        rest_s = FIRST_REST_S
        while not self._closing.is_set():
            try:
                self._open()
                rest_s = FIRST_REST_S
                self._serve()
                why = "closed"
            except OSError as error:
                why = str(error)
            self._drop()
            self.session.closed(why, time.monotonic_ns())
            self._tell()
            self._rest(rest_s)
            rest_s = min(2 * rest_s, LONGEST_REST_S)

    def _open(self) -> None:
        port = serial.Serial(
            self._device, self._timing.baud, timeout=TICK_S, write_timeout=WRITE_S, exclusive=True
        )
        # Only some adapters can: without it an FTDI chip keeps every answer back for up to 16 ms.
        with suppress(ValueError, AttributeError, NotImplementedError):
            port.set_low_latency_mode(True)
        with self._port_lock:
            self._port = port
        self.session.opened(time.monotonic_ns())

    def _serve(self) -> None:
        """Orders -> write -> receive, until the port fails, or told to close and the STOP is answered."""
        port = self._port
        while port is not None:
            closing = self._closing.is_set()  # looked at first: `close` gives its order before
            self._obey()
            line = self.session.due(time.monotonic_ns())
            if line:
                port.write(line)
            self._tell()
            if closing and self.session.quiet:
                return
            heard = port.read(min(max(1, port.in_waiting), LONGEST_READ))
            self.session.receive(heard, time.monotonic_ns())
            if self.session.babble > MOST_BABBLE:
                raise OSError(NOT_A_GLOVE)

    def _obey(self) -> None:
        with suppress(queue.Empty):
            while True:
                self._orders.get_nowait()(self.session, time.monotonic_ns())

    def _rest(self, seconds: float) -> None:
        """Waits before the next attempt; what is asked for meanwhile fails at once."""
        until = time.monotonic() + seconds
        while not self._closing.is_set() and (left := until - time.monotonic()) > 0:
            self._wake.wait(left)
            self._wake.clear()
            self._obey()
            self._tell()

    def _drop(self) -> None:
        with self._port_lock:
            port, self._port = self._port, None
        if port is not None:
            with suppress(OSError):
                port.close()

    def _tell(self) -> None:
        """Hands reports over, and logs why there is no session, or that there is one, when that changes."""
        for report in self.session.take_reports():
            self._reports.put(report)
        if self.session.fault != self._told:
            self._told = self.session.fault
            _log.info("%s: %s", self._device, self._told or "the glove is there")
