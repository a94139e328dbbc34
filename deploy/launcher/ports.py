"""Free ports of this machine."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from shared.nodes import LOOPBACK


def free_ports(tcp: int, udp: int) -> tuple[list[int], list[int]]:
    """Finds ports on loopback that nothing uses at this moment.

    All are held until the last is found, so they differ from each other.

    Args:
        tcp: How many TCP ports.
        udp: How many UDP ports.

    Returns:
        The TCP and the UDP ports.
    """
    with ExitStack() as held:
        return (
            [held.enter_context(_bound(socket.SOCK_STREAM)) for _ in range(tcp)],
            [held.enter_context(_bound(socket.SOCK_DGRAM)) for _ in range(udp)],
        )


def free_port_near(preferred: int) -> int:
    """Returns the preferred TCP port on loopback if nothing listens there, else any free one."""
    try:
        with socket.create_server((LOOPBACK, preferred)):
            return preferred
    except OSError:
        (port,), _ = free_ports(tcp=1, udp=0)
        return port


@contextmanager
def _bound(kind: socket.SocketKind) -> Iterator[int]:
    with socket.socket(socket.AF_INET, kind) as opened:
        opened.bind((LOOPBACK, 0))
        yield opened.getsockname()[1]
