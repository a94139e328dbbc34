"""Whose program is at the other end of a connection within this machine: Linux tells, other systems do not.

The question goes to the kernel as `sock_diag(7)` has it, about one pair of addresses; looking through
`/proc/net/tcp` instead would take the longer the more connections anybody makes.
"""

import contextlib
import os
import socket
import struct
import sys

from shared.nodes import LOOPBACK

NETLINK_SOCK_DIAG = 4
_SOCK_DIAG_BY_FAMILY, _REQUEST = 20, 1
_ESTABLISHED = 1
_WAIT_S = 0.2
_LONGEST_ANSWER = 4096

_HEADER = struct.Struct("=IHHII")
"""`nlmsghdr`: length, type, flags, seq, port."""
_QUESTION = struct.Struct("=BBBxI2s2s16s16sIII")
"""`inet_diag_req_v2`: family, protocol, ext, states; ports and addresses, near end first; interface, cookie."""
_ANSWER = struct.Struct("=BBxx48xIIIII")
"""`inet_diag_msg`: family, state, (timer, ends), expires, rqueue, wqueue, uid, inode."""
_NO_COOKIE = 0xFFFFFFFF


class Peers:
    """Asks the kernel; closed by `close`.

    Attributes:
        works: Whether it tells.
    """

    def __init__(self) -> None:
        self._socket: socket.socket | None = None
        if sys.platform == "linux":
            with contextlib.suppress(OSError):
                self._socket = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, NETLINK_SOCK_DIAG)
                self._socket.settimeout(_WAIT_S)
        self.works = self._knows_me()

    def user(self, connection: socket.socket) -> int | None:
        """Returns the number of the user whose program is at the other end.

        Args:
            connection: An accepted TCP connection.

        Returns:
            None if there is no telling: another machine, a program that is gone, or a system that does not say.
        """
        if self._socket is None or connection.family not in (socket.AF_INET, socket.AF_INET6):
            return None
        try:
            near, far = connection.getsockname()[:2], connection.getpeername()[:2]
            self._socket.send(_question(far, near))
            return _user_in(self._socket.recv(_LONGEST_ANSWER))
        except (OSError, ValueError, struct.error):
            return None

    def close(self) -> None:
        """Closes the way to the kernel."""
        if self._socket is not None:
            self._socket.close()

    def _knows_me(self) -> bool:
        with (
            socket.create_server((LOOPBACK, 0)) as listener,
            socket.create_connection(listener.getsockname()),
            listener.accept()[0] as accepted,
        ):
            return self.user(accepted) == os.getuid()


def _question(mine: tuple[str, int], other: tuple[str, int]) -> bytes:
    """Asks for the socket at `mine` that is connected to `other`."""
    family, here = _packed(mine[0])
    _, there = _packed(other[0])
    ports = (struct.pack(">H", port) for _, port in (mine, other))
    body = _QUESTION.pack(
        family, socket.IPPROTO_TCP, 0, 1 << _ESTABLISHED, *ports, here, there, 0, _NO_COOKIE, _NO_COOKIE
    )
    return _HEADER.pack(_HEADER.size + len(body), _SOCK_DIAG_BY_FAMILY, _REQUEST, 1, 0) + body


def _packed(host: str) -> tuple[int, bytes]:
    """Returns family and address; an IPv4 address that is written as an IPv6 one is the former."""
    host = host.partition("%")[0].removeprefix("::ffff:")
    if ":" in host:
        return socket.AF_INET6, socket.inet_pton(socket.AF_INET6, host)
    return socket.AF_INET, socket.inet_pton(socket.AF_INET, host).ljust(16, b"\0")


def _user_in(answer: bytes) -> int | None:
    """Reads the kernel's answer; a socket without an inode is one that its program has left."""
    _, kind, _, _, _ = _HEADER.unpack_from(answer)
    if kind != _SOCK_DIAG_BY_FAMILY:
        return None
    _, state, _, _, _, uid, inode = _ANSWER.unpack_from(answer, _HEADER.size)
    return int(uid) if state == _ESTABLISHED and inode else None
