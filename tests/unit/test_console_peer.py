"""The kernel says whose program is at the other end of a connection."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing

import pytest

from observer.console.peer import Peers

NOBODY = 65_534
CONNECT = """import os, socket, sys
end = socket.socket(getattr(socket, sys.argv[1]))
os.setgroups([]); os.setgid(65534); os.setuid(65534)
end = socket.socket(end.family); end.connect((sys.argv[2], int(sys.argv[3])))
print("there", flush=True); sys.stdin.read(1); end.close(); print("gone", flush=True); sys.stdin.read()"""
FAMILIES = {"AF_INET": "127.0.0.1", "AF_INET6": "::1"}


@pytest.fixture
def peers() -> Iterator[Peers]:
    with closing(Peers()) as asked:
        if not asked.works:
            pytest.skip("this system does not tell whose a connection is")
        yield asked


@pytest.fixture(params=FAMILIES)
def listener(request: pytest.FixtureRequest) -> Iterator[socket.socket]:
    try:
        made = socket.create_server((FAMILIES[request.param], 0), family=getattr(socket, request.param))
    except OSError as error:
        pytest.skip(f"no {request.param}: {error}")
    with made:
        yield made


def test_it_is_mine(peers: Peers, listener: socket.socket) -> None:
    with socket.create_connection(listener.getsockname()[:2]) as mine, listener.accept()[0] as accepted:
        assert peers.user(accepted) == os.getuid()
        mine.close()
        assert peers.user(accepted) is None, "whoever is gone is nobody's"


@pytest.mark.skipif(os.getuid() != 0, reason="only root can be somebody else")
def test_it_is_somebody_elses(peers: Peers, listener: socket.socket) -> None:
    family = next(name for name in FAMILIES if getattr(socket, name) == listener.family)
    host, port = listener.getsockname()[:2]
    command = [sys.executable, "-c", CONNECT, family, host, str(port)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        try:
            assert other.stdin is not None
            assert other.stdout is not None
            assert other.stdout.readline() == "there\n"
            with listener.accept()[0] as accepted:
                assert peers.user(accepted) == NOBODY
                other.stdin.write("x")
                other.stdin.flush()
                assert other.stdout.readline() == "gone\n"
                assert peers.user(accepted) is None
        finally:
            other.kill()


def test_a_connection_that_comes_in_by_ipv6_for_ipv4_is_known(peers: Peers) -> None:
    try:
        both = socket.create_server(("::", 0), family=socket.AF_INET6, dualstack_ipv6=True)
    except OSError as error:
        pytest.skip(f"no IPv6: {error}")
    with (
        both,
        socket.create_connection(("127.0.0.1", both.getsockname()[1])),
        both.accept()[0] as accepted,
    ):
        assert accepted.getpeername()[0] == "::ffff:127.0.0.1"
        assert peers.user(accepted) == os.getuid()


def test_a_connection_that_is_none_is_nobodys(peers: Peers) -> None:
    with socket.socket() as unconnected:
        assert peers.user(unconnected) is None
    one, other = socket.socketpair()
    with one, other:
        assert peers.user(one) is None


def test_where_the_kernel_does_not_tell_nobody_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    with closing(Peers()) as asked:
        assert not asked.works
