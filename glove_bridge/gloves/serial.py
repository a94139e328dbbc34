"""`serial://DEVICE?baud=115200&link=usb&calibration=FILE`: a glove on a serial line, directly or by radio.

`link=xbee` is a pair of XBee radios in transparent mode: 57600 baud, a longer dead-man, more patience.
"""

import time
from collections import Counter

import attrs

from glove_bridge.calibration import Calibration, device_frames
from glove_bridge.calibration_file import load_calibration
from glove_bridge.gloves.base import CLOSED, Outcome, Report
from glove_bridge.gloves.serial_link import SerialLink
from glove_bridge.link_timing import USB, XBEE, LinkTiming
from glove_bridge.patterns.pattern import Pattern
from glove_bridge.session import Session
from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.files import named
from shared.uri import Uri

_RATES = (9600, 19200, 38400, 57600, 115200)
_LINKS = {"usb": USB, "xbee": XBEE}
_POLL_NS = 2_000_000
"""How soon to poll again while the device has something to say."""

HANGS = "its line hangs"

FRESH_NS = 500_000_000
"""A pattern that the line's thread finds later than this is not played any more: it would be about the past."""
OVERDUE_NS = 2 * NS_PER_S
"""A pattern that has not ended so long after its length never will: the thread of the line hangs."""


class SerialGlove:
    """A glove that times its patterns itself; see `Glove`.

    A pattern has started when the device has acknowledged it, and ended when the device says so. It fails if it
    is not acknowledged after two repetitions, if something else is asked for, if the line dies, or if the
    device's answers cannot be true. It ends in any case, even if the operating system does not return from a
    call.

    Args:
        uri: The device as its path; see above.

    Raises:
        ConfigError: No device, a wrong option, or a calibration that is refused. A device that is not there is
            waited for.
    """

    def __init__(self, uri: Uri) -> None:
        self._calibration, timing = _options(uri)
        self.link = SerialLink(uri.path, timing)
        # Every pattern ends exactly once, in the order of the wishes: counting tells whom a report is about.
        self._asked = self._ended = self._given_up = 0
        self._overdue_ns = 0
        self._closed = False
        self._reports: list[Report] = []
        self._offset_ns: int | None = None
        self._polled_ns = 0

    @staticmethod
    def check(uri: Uri) -> None:
        """See `GloveBackend.check`."""
        _options(uri)

    @property
    def connected(self) -> bool:
        """See `Glove.connected`."""
        return not self.fault

    @property
    def fault(self) -> str:
        """See `Glove.fault`."""
        if self._closed:
            return CLOSED
        return HANGS if self._given_up > self._ended else self.link.session.fault

    @property
    def rejected(self) -> Counter[str]:
        """See `Glove.rejected`."""
        return self.link.session.rejected

    def play(self, pattern: Pattern, now_ns: int) -> None:
        """See `Glove.play`."""
        self._note(now_ns)
        if self._closed:
            self._reports.append(Report(Outcome.FAILED, now_ns, CLOSED))
            return
        frames = device_frames(pattern, self._calibration)
        asked_ns = time.monotonic_ns()
        self._asked += 1
        self._overdue_ns = now_ns + pattern.length_ms * NS_PER_S // 1000 + OVERDUE_NS

        def order(session: Session, at_ns: int) -> None:
            if at_ns - asked_ns > FRESH_NS:
                session.refuse("the line was busy for too long", at_ns)
            else:
                session.play(frames, at_ns)

        self.link.order(order)

    def poll(self, now_ns: int) -> list[Report]:
        """See `Glove.poll`."""
        offset = self._note(now_ns)
        for report in self.link.reports():
            if self._ended >= self._given_up:
                self._reports.append(report._replace(at_ns=report.at_ns + offset))
            self._ended += report.outcome is not Outcome.STARTED
        if self._waiting and now_ns > self._overdue_ns:
            hung = Report(Outcome.FAILED, now_ns, HANGS)
            self._reports += [hung] * (self._asked - max(self._ended, self._given_up))
            self._given_up = self._asked
            self.link.order(Session.stop)
        reports, self._reports = self._reports, []
        return reports

    def next_ns(self) -> int | None:
        """See `Glove.next_ns`."""
        return self._polled_ns + _POLL_NS if self._waiting else None

    def stop(self, now_ns: int) -> None:
        """See `Glove.stop`."""
        self._note(now_ns)
        if self._waiting and not self._closed:
            self.link.order(Session.stop)

    def close(self) -> None:
        """See `Glove.close`."""
        if not self._closed:
            self._closed = True
            self.link.close()

    @property
    def _waiting(self) -> bool:
        return self._asked > max(self._ended, self._given_up)

    def _note(self, now_ns: int) -> int:
        """Learns how far the caller's clock is ahead of the line's.

        A caller looks at its clock before it calls, never after: the largest offset is the nearest.
        """
        offset = now_ns - time.monotonic_ns()
        self._offset_ns = offset if self._offset_ns is None else max(self._offset_ns, offset)
        self._polled_ns = now_ns
        return self._offset_ns


def _options(uri: Uri) -> tuple[Calibration, LinkTiming]:
    uri.refuse_unknown("baud", "link", "calibration")
    if not uri.path:
        raise ConfigError(f"{uri.text}: no device; for example serial:///dev/ttyACM0")
    calibration = uri.options.get("calibration")
    return load_calibration(named(calibration) if calibration else None), link_timing(uri)


def link_timing(uri: Uri) -> LinkTiming:
    """Reads the options `link` and `baud`.

    Raises:
        ConfigError: Another link than `usb` or `xbee`, or a rate that not every port has.
    """
    name = uri.options.get("link", "usb")
    if name not in _LINKS:
        raise ConfigError(f"{uri.text}: link={name}; known ones: {', '.join(_LINKS)}")
    timing = _LINKS[name]
    rates = {str(rate): rate for rate in _RATES}
    baud = uri.options.get("baud", str(timing.baud))
    if baud not in rates:
        raise ConfigError(f"{uri.text}: baud={baud}; known ones: {', '.join(rates)}")
    return attrs.evolve(timing, baud=rates[baud])
