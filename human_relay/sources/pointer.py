"""A hand that a console points with: `pointer://HOST:PORT?speed=..&acceleration=..`, loopback only.

Datagrams are those of `shared.pointer_link`. The hand is released when its holder says so or is silent for
0.3 s; it then stays where it is, and the relay says HOLD. `speed` (m/s) and `acceleration` (m/s^2) bound it.
"""

import ipaddress
import logging
import socket
from urllib.parse import urlsplit

from attrs import evolve

from human_relay.pointing import Limits, PointerState, advance, hear, is_watched
from human_relay.sources.base import HandPose
from human_relay.sources.playback import PERIOD_NS
from shared.errors import ConfigError, DecodeError, DeviceError
from shared.messages import NO_HAND, Wish
from shared.pointer_link import DEFAULT_PORT, LOOPBACK, MAX_DATAGRAM, decode_pointed
from shared.uri import Uri

SPEED = 0.75
"""Derated as the paper's law wants it, m/s."""
ACCELERATION = 3.0

_MOST_DATAGRAMS = 256
"""Read per poll: a flood must not hold the relay up."""
_log = logging.getLogger("pointer")


class PointerHand:
    """The `pointer:` backend."""

    def __init__(self, uri: Uri, start_ns: int) -> None:
        """Listens at once.

        Raises:
            ConfigError: Unknown option, a value out of range, or an address that is not on loopback.
            DeviceError: The port is in use.
        """
        host, port = pointer_address(uri)
        self._limits = _limits(uri)
        self._state = PointerState(moved_ns=start_ns)
        self._due_ns = start_ns
        self._rejected = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise DeviceError(f"{uri.text}: cannot listen: {error}; is another relay running?") from error

    @staticmethod
    def hints(uri: Uri) -> dict[str, object]:
        """A pointer points in the world frame: it says nothing about the mapping."""
        pointer_address(uri)
        _limits(uri)
        return {}

    @property
    def port(self) -> int:
        """UDP port that it listens on."""
        port: int = self._socket.getsockname()[1]
        return port

    @property
    def finished(self) -> bool:
        """A pointer never ends; whoever points may come back."""
        return False

    def poll(self, now_ns: int) -> HandPose | None:
        """Returns the hand on a grid of 60 Hz while it is held, None while it is not; a STOP lasts."""
        self._receive(now_ns)
        if now_ns >= self._due_ns:
            self._due_ns = max(self._due_ns + PERIOD_NS, now_ns)
            self._state = advance(self._state, now_ns, self._limits)
        state = self._state
        if state.stopped:
            return HandPose(
                position=state.position or NO_HAND, yaw=state.yaw, mode=Wish.STOP, t_ns=state.moved_ns
            )
        if state.sender is None or state.position is None:
            return None
        return HandPose(position=state.position, yaw=state.yaw, mode=state.wish, t_ns=state.moved_ns)

    def next_ns(self, now_ns: int) -> int:
        """Returns the next point of the grid."""
        return max(self._due_ns, now_ns)

    def is_watched(self, now_ns: int) -> bool:
        """Says whether pages are open that could take the hand."""
        return is_watched(self._state, now_ns)

    def rest_at(self, pose: HandPose) -> None:
        """Puts the hand, while nobody holds it, where another source has it."""
        if self._state.sender is None:
            self._state = evolve(self._state, position=pose.position, yaw=pose.yaw)

    def close(self) -> None:
        """Stops listening."""
        self._socket.close()

    def _receive(self, now_ns: int) -> None:
        for _ in range(_MOST_DATAGRAMS):
            try:
                datagram = self._socket.recv(MAX_DATAGRAM)
            except OSError:  # nothing more, or closed
                return
            try:
                self._state = hear(self._state, decode_pointed(datagram), now_ns)
            except DecodeError as error:
                self._rejected += 1
                if self._rejected & (self._rejected - 1) == 0:  # the 1st, 2nd, 4th, 8th ...
                    _log.warning("dropped a datagram: %s (so far %d)", error, self._rejected)


def _limits(uri: Uri) -> Limits:
    uri.refuse_unknown("speed", "acceleration")
    return Limits(
        speed=uri.number("speed", SPEED, low=0.01, high=3.0),
        acceleration=uri.number("acceleration", ACCELERATION, low=0.1, high=20.0),
    )


def pointer_address(uri: Uri) -> tuple[str, int]:
    """Returns host and port that a pointer listens on.

    Raises:
        ConfigError: It is no IPv4 address on loopback.
    """
    try:
        parts = urlsplit(f"//{uri.path}")
        host, port = parts.hostname or LOOPBACK, DEFAULT_PORT if parts.port is None else parts.port
        is_loopback = ipaddress.IPv4Address(host).is_loopback and not parts.path
    except ValueError:
        is_loopback = False
    if not is_loopback:
        raise ConfigError(
            f"{uri.text}: expected an IPv4 address on loopback, for example pointer://{LOOPBACK}:{DEFAULT_PORT};"
            " whoever can reach this port can fly"
        )
    return host, port
