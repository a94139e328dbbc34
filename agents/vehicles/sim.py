"""Driver of a simulated vehicle: `sim://host:port/id` talks to the world process."""

import re
import socket
import time
from collections import Counter
from collections.abc import Callable
from urllib.parse import urlsplit

from agents.vehicles.base import Pose
from agents.vehicles.link import MAX_DATAGRAM, Verb, decode_pose, encode_order
from shared.errors import ConfigError, DecodeError, DeviceError
from shared.messages import ORIGIN, Vector

HELLO_PERIOD_S = 0.25
"""After this long without a command `pose` says hello, so either side may start late or come back."""


_DRONE = re.compile(r"/([0-9]{1,5})")


class SimVehicle:
    """One body in the world; see `Vehicle`.

    Args:
        uri: `sim://host:port/id`.
        clock: Monotonic seconds.

    Attributes:
        rejected: Refused datagrams by reason.

    Raises:
        ConfigError: The URI is not of that form.
        DeviceError: The host has no address.
    """

    def __init__(self, uri: str, clock: Callable[[], float] = time.monotonic) -> None:
        host, port, self._drone = parse_uri(uri)
        self._clock = clock
        self._last_sent = -float("inf")
        self._pose: Pose | None = None
        self.rejected: Counter[str] = Counter()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            # A connected socket takes datagrams from the world alone.
            self._socket.connect((host, port))
        except OSError as error:
            self._socket.close()
            raise DeviceError(f"vehicle {uri!r}: {error}; is the host name right?") from error

    def pose(self) -> Pose | None:
        """See `Vehicle.pose`."""
        if self._clock() - self._last_sent > HELLO_PERIOD_S:
            self._send(Verb.HELLO)
        while (datagram := self._receive()) is not None:
            try:
                drone, pose = decode_pose(datagram)
            except DecodeError as error:
                self.rejected[error.reason] += 1
                continue
            if drone == self._drone:
                self._pose = pose
        return self._pose

    def fly(self, setpoint: Vector) -> None:
        """See `Vehicle.fly`."""
        self._send(Verb.FLY, setpoint)

    def descend(self) -> None:
        """See `Vehicle.descend`."""
        self._send(Verb.DESCEND)

    def idle(self) -> None:
        """See `Vehicle.idle`."""
        self._send(Verb.IDLE)

    def stop(self) -> None:
        """See `Vehicle.stop`."""
        self._send(Verb.STOP)

    def close(self) -> None:
        """See `Vehicle.close`."""
        self._socket.close()

    def _send(self, verb: Verb, setpoint: Vector = ORIGIN) -> None:
        self._last_sent = self._clock()
        try:
            self._socket.send(encode_order(self._drone, verb, setpoint))
        except OSError:
            # No world at the moment, or a full buffer: the next command or hello tries again.
            self.rejected["unsent"] += 1

    def _receive(self) -> bytes | None:
        while True:
            try:
                return self._socket.recv(MAX_DATAGRAM)
            except ConnectionError:
                # Says once that an earlier datagram found no world; poses may be queued behind it.
                continue
            except OSError:
                return None


def parse_uri(uri: str) -> tuple[str, int, int]:
    """Reads `sim://host:port/id`.

    Returns:
        Host, port and number of the drone.

    Raises:
        ConfigError: The URI is not of that form.
    """
    try:
        parts = urlsplit(uri)
        host, port, drone = parts.hostname, parts.port, _DRONE.fullmatch(parts.path)
    except ValueError:
        host = port = drone = None
    if not (host and port and drone):
        raise ConfigError(f"vehicle {uri!r}: expected sim://host:port/id, for example sim://127.0.0.1:7400/2")
    return host, port, int(drone[1])
