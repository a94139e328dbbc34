"""Unix datagram sockets that only their own user can reach: what one program tells another on this machine.

The file system judges who may send: the socket has mode 0600 and lies in a folder with mode 0700. So its name
is no secret, and may stand in command lines and files that everybody reads.
"""

import contextlib
import fcntl
import os
import socket
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

from shared.errors import DeviceError

LONGEST_PATH = 100
"""Bytes; operating systems take 103 to 107."""

_FOLDER = "swarmtouch"


def private_path(name: str) -> Path:
    """Finds the place of a socket.

    Args:
        name: An absolute path, or a name in this user's own folder, which is made if it is missing:
            `$XDG_RUNTIME_DIR/swarmtouch`, or `swarmtouch-UID` among the temporary files.

    Raises:
        DeviceError: The folder cannot be made, or somebody else could enter it.
    """
    path = Path(name)
    if not path.is_absolute():
        path = _own_folder() / name
    if len(os.fsencode(path)) > LONGEST_PATH:
        raise DeviceError(f"{path}: too long for a socket, at most {LONGEST_PATH} bytes; choose a shorter path")
    return path


class PrivateListener:
    """Takes datagrams from this user's programs.

    Args:
        path: Where; what a listener that was killed has left there is replaced.

    Raises:
        DeviceError: Somebody listens there, or it cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._socket = _new_socket()
        try:
            with _locked(path.parent):
                self._bind()
        except OSError as error:
            self._socket.close()
            raise DeviceError(f"{path}: cannot listen: {error}") from error
        except DeviceError:
            self._socket.close()
            raise

    def receive(self, most: int) -> bytes | None:
        """Returns the next datagram, cut to `most` bytes; None if there is none, or it is closed."""
        try:
            return self._socket.recv(most)
        except OSError:
            return None

    def close(self) -> None:
        """Stops listening; further calls do nothing."""
        if self._socket.fileno() >= 0:
            self._socket.close()
            with contextlib.suppress(OSError):
                if self._path.lstat().st_ino == self._inode:
                    self._path.unlink()

    def _bind(self) -> None:
        if _is_listening(self._path):
            raise DeviceError(f"{self._path}: somebody listens there; is another relay running?")
        with contextlib.suppress(FileNotFoundError):
            if not stat.S_ISSOCK(self._path.lstat().st_mode):
                raise DeviceError(f"{self._path}: cannot listen: there is a file that is no socket")
            self._path.unlink()
        with contextlib.suppress(OSError):  # on Linux: nobody gets in between binding and the next line
            os.fchmod(self._socket.fileno(), 0o600)
        self._socket.bind(str(self._path))
        self._path.chmod(0o600)
        self._inode = self._path.lstat().st_ino


class PrivateSender:
    """Sends datagrams to a listener of this user, which may come, go and come back.

    Args:
        name: Its place, as for `private_path`; empty for nobody.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._socket = _new_socket() if name else None

    def send(self, datagram: bytes) -> str:
        """Sends one; never waits and raises nothing.

        Returns:
            Why nobody hears it, empty if somebody does. A listener that is behind loses it, and hears the next.
        """
        if self._socket is None:
            return "this flight has no hand that could be pointed"
        try:
            self._socket.sendto(datagram, str(private_path(self._name)))
        except BlockingIOError:
            return ""
        except (FileNotFoundError, ConnectionRefusedError):
            return f"nobody listens at {self._name}"
        except (OSError, DeviceError) as error:
            return str(error)
        return ""

    def close(self) -> None:
        """Closes it."""
        if self._socket is not None:
            self._socket.close()


def _new_socket() -> socket.socket:
    if not hasattr(socket, "AF_UNIX"):
        raise DeviceError("this system has no Unix sockets: a console and its relay cannot meet here")
    opened = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    opened.setblocking(False)
    return opened


def _own_folder() -> Path:
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    folder = (
        Path(runtime) / _FOLDER
        if Path(runtime).is_absolute() and Path(runtime).is_dir()
        else Path(tempfile.gettempdir()) / f"{_FOLDER}-{os.getuid()}"
    )
    try:
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        found = folder.lstat()
    except OSError as error:
        raise DeviceError(f"{folder}: {error}; set XDG_RUNTIME_DIR to a folder of yours") from error
    # Whoever was there first under a name in /tmp could exchange the socket.
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise DeviceError(
            f"{folder}: not a folder of yours that nobody else can enter (mode 0700); remove it, or set"
            " XDG_RUNTIME_DIR to a folder of yours"
        )
    return folder


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Keeps others who start at the same moment from taking a socket for one that was left behind."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)


def _is_listening(path: Path) -> bool:
    with contextlib.closing(_new_socket()) as probe:
        try:
            probe.connect(str(path))
        except (FileNotFoundError, ConnectionRefusedError):
            return False
    return True
