"""The records of an MCAP file, whole or damaged, one after the other and within stated bounds.

The package `mcap`, which writes our traces, ends at the first byte that is wrong in the frame of a record and
unpacks whatever it is given. Here a record counts if the next one begins where it ends; from where none does,
the next place is looked for from which on they do.
"""

import re
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from shared.recordings.unpack import LARGEST_CHUNK, UnpackError, unpack

ENCODING = "msgpack"
"""Of the messages in our traces."""

_HEAD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQI")
_LENGTH, _LONG = struct.Struct("<I"), struct.Struct("<Q")
_MESSAGE = struct.Struct("<HIQQ")
_KNOWN = range(1, 0x10)
_LIKELY = re.compile(rb"[\x01-\x0f].{5}\x00\x00\x00", re.DOTALL)
"""The head of a record that is known and shorter than a TB."""
_LONGEST = 1 << 40
_SURE = 3
"""So many records after each other are no accident."""
_BLOCK = 1 << 20
_LONGEST_NAME = 4096


class Located(NamedTuple):
    """Where a record is.

    Attributes:
        opcode: Its kind.
        begin: First byte of its content.
        end: First byte behind it.
    """

    opcode: int
    begin: int
    end: int


class ChannelRecord(NamedTuple):
    """A topic, and how what is said on it is encoded."""

    id: int
    topic: str
    encoding: str


class MessageRecord(NamedTuple):
    """One message, as the format has it."""

    channel_id: int
    sequence: int
    log_ns: int
    publish_ns: int
    data: bytes


class DamageError(Exception):
    """A record whose content is not what it should be."""


class McapFile:
    """A file that is open for reading, as long as it was then.

    Args:
        stream: The file.

    Attributes:
        size: Its length, bytes.
        lost: Bytes between whole records that are none, as far as has been read.
        has_end: Whether it was finished.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.size = stream.seek(0, 2)
        self.lost = 0
        self.has_end = self.size > 2 * len(MCAP0_MAGIC) and self._at(-len(MCAP0_MAGIC)) == MCAP0_MAGIC
        self._end = self.size - len(MCAP0_MAGIC) * self.has_end

    def records(self) -> Iterator[Located]:
        """Yields where every whole record outside chunks is, in order; what is cut off at the end is none."""
        self.lost = 0
        place = len(MCAP0_MAGIC)
        while place < self._end:
            found = self._record_at(place)
            if found is None:
                later = self._next_after(place)
                if later is None:
                    self.lost += (self._end - place) * self.has_end
                    return
                self.lost += later - place
                place = later
                continue
            yield found
            place = found.end

    def content(self, record: Located) -> bytes:
        """Reads a record.

        Raises:
            DamageError: It is too large.
        """
        if record.end - record.begin > LARGEST_CHUNK:
            raise DamageError(f"a record of more than {LARGEST_CHUNK >> 20} MiB")
        self._stream.seek(record.begin)
        return self._stream.read(record.end - record.begin)

    def _at(self, place: int, size: int = len(MCAP0_MAGIC)) -> bytes:
        self._stream.seek(place, 2 if place < 0 else 0)
        return self._stream.read(size)

    def _frame(self, place: int) -> Located | None:
        """Returns the record at a place if its frame fits into the file."""
        head = self._at(place, _HEAD.size)
        if len(head) < _HEAD.size:
            return None
        opcode, length = _HEAD.unpack(head)
        begin = place + _HEAD.size
        return Located(opcode, begin, begin + length) if opcode and begin + length <= self._end else None

    def _record_at(self, place: int) -> Located | None:
        """Returns the record at a place if another one, or the end, follows it."""
        found = self._frame(place)
        if found is None or not self._holds(found):
            return None
        if found.end == self._end or self._frame(found.end) is not None:
            return found
        # The last record of a file that was cut off may follow: its frame goes beyond the end.
        head = self._at(found.end, _HEAD.size)
        if len(head) < _HEAD.size:
            return None if self.has_end else found
        opcode, length = _HEAD.unpack(head)
        return found if not self.has_end and opcode in _KNOWN and length < _LONGEST else None

    def _holds(self, found: Located) -> bool:
        """Says whether metadata ends where it says: a wrong length may meet a later record."""
        try:
            return found.opcode != METADATA or bool(read_metadata(self.content(found)))
        except DamageError:
            return False

    def _next_after(self, place: int) -> int | None:
        """Looks for the next place from which on there are records."""
        begin = place + 1
        while begin < self._end:
            block = self._at(begin, _BLOCK + _HEAD.size)
            for likely in _LIKELY.finditer(block):
                if self._is_chain(begin + likely.start()):
                    return begin + likely.start()
            begin += _BLOCK
        return None

    def _is_chain(self, place: int) -> bool:
        for _ in range(_SURE):
            found = self._frame(place)
            if found is None or found.opcode not in _KNOWN:
                return False
            if found.end == self._end:
                return True
            place = found.end
        return True


def begins_as_mcap(path: Path) -> bool:
    """Says whether a file begins as every MCAP file does; raises `OSError`."""
    with path.open("rb") as stream:
        return stream.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC


def open_chunk(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Yields kind and content of every record in a chunk, bit by bit: a replay has no time for a whole one.

    Raises:
        DamageError: It is damaged, would grow beyond all bounds, or is packed in an unknown way.
    """
    try:
        _, _, size, crc = _CHUNK.unpack_from(content)
        compression, at = _text(content, _CHUNK.size)
        (length,) = _LONG.unpack_from(content, at)
        packed = content[at + _LONG.size :]
        if len(packed) != length:
            raise DamageError("a chunk of another length than it says")
        data = unpack(packed, compression, min(size, LARGEST_CHUNK))
    except (struct.error, UnicodeDecodeError, UnpackError) as error:
        raise DamageError(str(error)) from error
    if crc and zlib.crc32(data) != crc:
        raise DamageError("a chunk with a wrong checksum")
    at = 0
    while at < len(data):
        if len(data) - at < _HEAD.size:
            raise DamageError("a chunk that ends within a record")
        opcode, length = _HEAD.unpack_from(data, at)
        at += _HEAD.size + length
        if at > len(data) or not opcode:
            raise DamageError("a chunk that ends within a record")
        yield opcode, data[at - length : at]


def read_channel(content: bytes) -> ChannelRecord:
    """Takes a channel apart; raises `DamageError`."""
    try:
        number = int.from_bytes(content[:2], "little")
        topic, at = _text(content, 4)
        encoding, _ = _text(content, at)
        if len(topic) + len(encoding) > _LONGEST_NAME:
            raise DamageError("a topic with a name that is none")
    except (struct.error, UnicodeDecodeError) as error:
        raise DamageError(str(error)) from error
    return ChannelRecord(number, topic, encoding)


def read_message(content: bytes) -> MessageRecord:
    """Takes a message apart; raises `DamageError`."""
    if len(content) < _MESSAGE.size:
        raise DamageError("a message without a head")
    channel, sequence, log_ns, publish_ns = _MESSAGE.unpack_from(content)
    return MessageRecord(channel, sequence, log_ns, publish_ns, content[_MESSAGE.size :])


def read_metadata(content: bytes) -> tuple[str, dict[str, str]]:
    """Takes metadata apart: its name, and its entries; raises `DamageError`."""
    try:
        name, at = _text(content, 0)
        texts = list(_texts(content, at + _LENGTH.size))
    except (struct.error, UnicodeDecodeError) as error:
        raise DamageError(str(error)) from error
    if len(texts) % 2:
        raise DamageError("metadata without a value")
    return name, dict(zip(texts[::2], texts[1::2], strict=True))


def read_message_count(content: bytes) -> int:
    """Returns how many messages the file's statistics count; 0 if they are damaged."""
    return int.from_bytes(content[: _LONG.size], "little") if len(content) >= _LONG.size else 0


def is_index(content: bytes) -> bool:
    """Says whether the content of an index of messages can be one."""
    return len(content) >= 6 and len(content) - 6 == _LENGTH.unpack_from(content, 2)[0]


def _text(content: bytes, at: int) -> tuple[str, int]:
    """Reads a text with its length before it; returns it and where it ends."""
    (length,) = _LENGTH.unpack_from(content, at)
    end = at + _LENGTH.size + length
    if end > len(content):
        raise struct.error("a text that goes beyond its record")
    return content[at + _LENGTH.size : end].decode(), end


def _texts(content: bytes, at: int) -> Iterator[str]:
    while at < len(content):
        text, at = _text(content, at)
        yield text


def open_mcap(path: Path) -> BinaryIO:
    """Opens a file in which records are looked up back and forth."""
    return path.open("rb", buffering=1 << 16)


MESSAGE, CHUNK, CHANNEL = int(Opcode.MESSAGE), int(Opcode.CHUNK), int(Opcode.CHANNEL)
METADATA, STATISTICS, MESSAGE_INDEX = int(Opcode.METADATA), int(Opcode.STATISTICS), int(Opcode.MESSAGE_INDEX)
