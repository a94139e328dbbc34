"""The records of a ROS 1 bag (format 2.0), read one after the other: a bag that was cut off has no index.

`rosbags`, which reads what is in the messages, refuses such bags and unpacks whatever it is given.
"""

import struct
from collections.abc import Callable, Iterator
from enum import IntEnum
from io import SEEK_CUR, BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from shared.clock import NS_PER_S
from shared.recordings.unpack import LARGEST_CHUNK, UnpackError, unpack

MAGIC = b"#ROSBAG V2.0\n"

_LARGEST_HEADER = 1 << 16
_MOST_CONNECTIONS = 1 << 16
Fields = dict[bytes, bytes]

_LENGTH, _TIME = struct.Struct("<I"), struct.Struct("<II")


class Connection(NamedTuple):
    """A topic of the bag and the type of what is said on it, for example `geometry_msgs/msg/PoseStamped`."""

    topic: str
    kind: str


class BagMessage(NamedTuple):
    """A message as it was recorded.

    Attributes:
        connection: What it was said on.
        arrival_ns: When it came to the recorder, ns.
        data: The message, serialised.
    """

    connection: Connection
    arrival_ns: int
    data: bytes


class BagRecords:
    """A bag; read once, from its begin to where it ends or cannot be read on.

    Args:
        path: The file.

    Attributes:
        connections: By their number in the bag, as far as has been read.
        damaged: Chunks that could not be read to their end.
        cut_at: The byte from which on nothing could be read: it was cut off there, or is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.connections: dict[int, Connection] = {}
        self.damaged = 0
        self.cut_at: int | None = None
        self._path = path

    def messages(self, is_wanted: Callable[[Connection], bool]) -> Iterator[BagMessage]:
        """Yields the messages on the wanted connections.

        Raises:
            OSError: The file cannot be read.
            ValueError: It is no ROS 1 bag.
        """
        with self._path.open("rb") as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise ValueError("it does not begin as ROS 1 bags do")
            while self.cut_at is None:
                begin = stream.tell()
                try:
                    kind, header, size = _head(stream)
                    if kind == _Kind.CHUNK:
                        yield from self._chunk(stream, header, size, is_wanted)
                    else:
                        yield from self._record(stream, kind, header, size, is_wanted)
                except EOFError:
                    return
                except _BROKEN:
                    self.cut_at = begin

    def _chunk(
        self, stream: BinaryIO, header: Fields, size: int, is_wanted: Callable[[Connection], bool]
    ) -> Iterator[BagMessage]:
        """Yields what is in a chunk, as far as it goes."""
        begin = stream.tell()
        if size > LARGEST_CHUNK:
            stream.seek(size, SEEK_CUR)
            self.damaged += 1
            return
        data = stream.read(size)
        try:
            unpacked = BytesIO(unpack(data, header[b"compression"].decode()))
            while True:
                yield from self._record(unpacked, *_head(unpacked), is_wanted)
        except EOFError:
            pass
        except _BROKEN:
            self.damaged += len(data) == size
        if len(data) < size:
            self.cut_at = begin + len(data)

    def _record(
        self, stream: BinaryIO, kind: int, header: Fields, size: int, is_wanted: Callable[[Connection], bool]
    ) -> Iterator[BagMessage]:
        """Reads what is no chunk: a message, a connection, or something else to be passed over."""
        data = _whole(stream, size)
        if kind == _Kind.MESSAGE:
            connection = self.connections[_LENGTH.unpack(header[b"conn"])[0]]
            if is_wanted(connection):
                seconds, nanoseconds = _TIME.unpack(header[b"time"])
                yield BagMessage(connection, seconds * NS_PER_S + nanoseconds, data)
        elif kind == _Kind.CONNECTION and len(self.connections) < _MOST_CONNECTIONS:
            package, _, name = _fields(data)[b"type"].decode().partition("/")
            number = _LENGTH.unpack(header[b"conn"])[0]
            self.connections[number] = Connection(header[b"topic"].decode(), f"{package}/msg/{name}")


class _Kind(IntEnum):
    MESSAGE = 2
    CHUNK = 5
    CONNECTION = 7


class _BrokenError(Exception):
    """A record that is not whole, or none."""


_BROKEN = (_BrokenError, UnpackError, LookupError, struct.error, UnicodeDecodeError)


def _head(stream: BinaryIO) -> tuple[int, Fields, int]:
    """Reads the kind of a record, its header and the size of its data; `EOFError` where the records end."""
    length = stream.read(_LENGTH.size)
    if not length:
        raise EOFError
    fields = _fields(_whole(stream, _LENGTH.unpack(length)[0], most=_LARGEST_HEADER))
    (size,) = _LENGTH.unpack(stream.read(_LENGTH.size))
    return fields[b"op"][0], fields, size


def _fields(data: bytes) -> Fields:
    """Takes `length name=value` fields apart."""
    fields, at = {}, 0
    while at < len(data):
        (length,) = _LENGTH.unpack_from(data, at)
        at += _LENGTH.size + length
        if at > len(data):
            raise _BrokenError
        name, _, value = data[at - length : at].partition(b"=")
        fields[name] = value
    return fields


def _whole(stream: BinaryIO, size: int, most: int = LARGEST_CHUNK) -> bytes:
    if size > most:
        raise _BrokenError
    data = stream.read(size)
    if len(data) < size:
        raise _BrokenError
    return data
