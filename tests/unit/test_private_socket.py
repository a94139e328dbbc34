"""Sockets of one user: who gets in, what a killed listener leaves, and folders that are not one's own."""

import os
import re
import signal
import stat
import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path

import pytest

from shared.errors import DeviceError
from shared.private_socket import LONGEST_PATH, PrivateListener, PrivateSender, private_path

NOBODY = 65_534
LISTEN = """import sys, time; from pathlib import Path; from shared.private_socket import PrivateListener
listener = PrivateListener(Path(sys.argv[1])); print("listening", flush=True); time.sleep(60)"""
SEND = """import os, sys; from shared.private_socket import PrivateSender
os.setgroups([]); os.setgid(65534); os.setuid(65534); print(PrivateSender(sys.argv[1]).send(b"STOP"))"""


@pytest.fixture
def folder(short_path: Path) -> Path:
    return short_path


@pytest.fixture
def mine(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    return folder / "swarmtouch"


def mode(path: Path) -> int:
    return stat.S_IMODE(path.lstat().st_mode)


def test_only_their_user_can_reach_the_socket_and_the_folder(mine: Path) -> None:
    old = os.umask(0)
    try:
        path = private_path("pointer.sock")
        with closing(PrivateListener(path)) as listener, closing(PrivateSender("pointer.sock")) as sender:
            assert path == mine / "pointer.sock"
            assert (mode(mine), mode(path)) == (0o700, 0o600)
            assert sender.send(b"hello") == ""
            assert listener.receive(64) == b"hello"
            assert listener.receive(64) is None
    finally:
        os.umask(old)


@pytest.mark.skipif(os.getuid() != 0, reason="only root can be somebody else")
def test_another_user_is_refused_by_the_socket_and_by_its_folder(folder: Path) -> None:
    folder.chmod(0o755)
    open_folder, own_folder = folder / "open", folder / "own"
    open_folder.mkdir(mode=0o777)
    open_folder.chmod(0o777)
    own_folder.mkdir(mode=0o700)
    for place in (open_folder, own_folder):
        with closing(PrivateListener(place / "pointer.sock")) as listener:
            said = subprocess.run(
                [sys.executable, "-c", SEND, str(place / "pointer.sock")],
                capture_output=True,
                text=True,
                check=True,
                timeout=30,
            ).stdout
            assert "Permission denied" in said
            assert listener.receive(64) is None


def test_what_a_killed_listener_has_left_is_replaced_and_a_living_one_is_not(folder: Path) -> None:
    path = folder / "pointer.sock"
    other = subprocess.Popen([sys.executable, "-c", LISTEN, str(path)], stdout=subprocess.PIPE, text=True)
    try:
        assert other.stdout is not None
        assert other.stdout.readline() == "listening\n"
        with pytest.raises(DeviceError, match="somebody listens there; is another relay running"):
            PrivateListener(path)
    finally:
        other.send_signal(signal.SIGKILL)
        other.communicate(timeout=30)
    assert path.is_socket()
    with closing(PrivateSender(str(path))) as sender:
        assert sender.send(b"x") == f"nobody listens at {path}"
        with closing(PrivateListener(path)) as listener:
            assert sender.send(b"y") == ""
            assert listener.receive(64) == b"y"
        assert sender.send(b"z") == f"nobody listens at {path}"
    assert not path.exists()


def test_closing_leaves_a_successors_socket_alone(folder: Path) -> None:
    path = folder / "pointer.sock"
    first = PrivateListener(path)
    path.unlink()
    with closing(PrivateListener(path)):
        first.close()
        first.close()
        assert path.is_socket()


def test_a_file_that_is_no_socket_is_not_removed(folder: Path) -> None:
    path = folder / "pointer.sock"
    path.write_text("mine")
    with pytest.raises(DeviceError, match="cannot listen"):
        PrivateListener(path)
    assert path.read_text() == "mine"


def test_a_full_listener_costs_datagrams_never_time(folder: Path) -> None:
    path = folder / "pointer.sock"
    with closing(PrivateListener(path)) as listener, closing(PrivateSender(str(path))) as sender:
        assert {sender.send(b"x" * 64) for _ in range(2_000)} == {""}
        while listener.receive(64):
            pass
        assert sender.send(b"newest") == ""
        assert listener.receive(3) == b"new"


def test_without_a_name_nobody_is_told() -> None:
    with closing(PrivateSender("")) as sender:
        assert "no hand that could be pointed" in sender.send(b"x")


def test_a_folder_that_others_can_enter_or_that_is_not_ones_own_is_refused(mine: Path) -> None:
    mine.mkdir(mode=0o700)
    mine.chmod(0o711)
    with pytest.raises(DeviceError, match="not a folder of yours that nobody else can enter"):
        private_path("pointer.sock")
    mine.chmod(0o700)
    mine.rename(mine.with_name("elsewhere"))
    mine.symlink_to(mine.with_name("elsewhere"))
    with pytest.raises(DeviceError, match="set XDG_RUNTIME_DIR"):
        private_path("pointer.sock")
    mine.unlink()
    mine.write_text("")
    with pytest.raises(DeviceError, match="not a folder of yours"):
        private_path("pointer.sock")
    if os.getuid() == 0:
        mine.unlink()
        mine.mkdir(mode=0o700)
        os.chown(mine, NOBODY, NOBODY)
        with pytest.raises(DeviceError, match="not a folder of yours"):
            private_path("pointer.sock")
    with closing(PrivateSender("pointer.sock")) as sender:
        assert "not a folder of yours" in sender.send(b"x"), "a sender says so and lives on"


@pytest.mark.parametrize("runtime", ["", "not/absolute", "/dev/null/missing"])
def test_without_a_folder_of_the_session_there_is_one_among_temporary_files(
    folder: Path, runtime: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", runtime)
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    assert private_path("pointer.sock") == folder / f"swarmtouch-{os.getuid()}" / "pointer.sock"


def test_a_path_that_is_too_long_is_refused(folder: Path) -> None:
    with pytest.raises(DeviceError, match=re.escape(f"at most {LONGEST_PATH} bytes")):
        private_path(str(folder / ("x" * LONGEST_PATH)))
    with pytest.raises(DeviceError, match="cannot listen"):
        PrivateListener(folder / "missing" / "pointer.sock")
