"""A hand that a console points with: `pointer://SOCKET?speed=..&acceleration=..`, on the same machine.

Datagrams are those of `shared.pointer_link`, on a socket that no other user can reach. SOCKET is a name, or an
absolute path (`pointer:///run/swarmtouch/pointer.sock`); it may be left out. The hand is released when its
holder says so or is silent for 0.3 s; it then stays where it is, and the relay says HOLD. `speed` (m/s) and
`acceleration` (m/s^2) bound it.
"""

import logging
from pathlib import Path

from attrs import evolve

from human_relay.pointing import Limits, PointerState, advance, hear, is_watched
from human_relay.sources.base import HandPose
from human_relay.sources.playback import PERIOD_NS
from shared.errors import ConfigError, DecodeError
from shared.messages import NO_HAND, Wish
from shared.pointer_link import DEFAULT_SOCKET, MAX_DATAGRAM, decode_pointed
from shared.private_socket import PrivateListener, private_path
from shared.uri import Uri

SPEED = 0.75
"""Derated as the paper's law wants it, m/s."""
ACCELERATION = 3.0

_MOST_DATAGRAMS = 256
"""Read per poll: a flood must not hold the relay up."""
_log = logging.getLogger("pointer")


class PointerHand:
    """The `pointer:` backend."""

    remarks: tuple[str, ...] = ()

    def __init__(self, uri: Uri, start_ns: int) -> None:
        """Listens at once.

        Raises:
            ConfigError: Unknown option, a value out of range, or no name of a socket.
            DeviceError: Another relay listens there.
        """
        name = pointer_socket(uri)
        self._limits = _limits(uri)
        self._state = PointerState(moved_ns=start_ns)
        self._due_ns = start_ns
        self._rejected = 0
        self._listener = PrivateListener(private_path(name))

    @staticmethod
    def hints(uri: Uri) -> dict[str, object]:
        """A pointer points in the world frame: it says nothing about the mapping."""
        pointer_socket(uri)
        _limits(uri)
        return {}

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
        self._listener.close()

    def _receive(self, now_ns: int) -> None:
        for _ in range(_MOST_DATAGRAMS):
            datagram = self._listener.receive(MAX_DATAGRAM)
            if datagram is None:
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


def pointer_socket(uri: Uri) -> str:
    """Returns name or absolute path of the socket that a pointer listens on.

    Raises:
        ConfigError: It is neither.
    """
    name = uri.path or DEFAULT_SOCKET
    if "\0" in name or not (Path(name).is_absolute() or (name == Path(name).name and ":" not in name)):
        raise ConfigError(
            f"{uri.text}: a pointer is heard on a socket of this machine: expected pointer://, pointer://NAME"
            " or pointer:///ABSOLUTE/PATH"
        )
    return name
