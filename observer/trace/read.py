"""Reads traces, whole or damaged: what is there is yielded, and what is not is said.

A trace is one MCAP file, or a run directory with several: a recorder that was killed and started again begins
a new one. A file that ends early (its recorder was killed) is read to its last complete chunk; a damaged chunk
is skipped.
"""

import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Metadata
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader, get_chunk_data_stream
from zstandard import ZstdError

from observer.swarm import LATEST, RUNS
from observer.trace.layout import RECORDER, SCENARIO, has_end, trace_files
from shared.codec import decode_on
from shared.config import structure_scenario
from shared.errors import ConfigError, DecodeError
from shared.messages import Message
from shared.scenario import Scenario
from shared.toml_text import parse_toml

_LARGEST_RECORD = 1 << 28
_LONGEST_COUNT = 20
_RETIRED = (("net", "pointer_port"),)
"""Keys of the scenario that earlier recorders wrote, and that mean nothing any more."""
_DAMAGE = (MemoryError, OverflowError, McapError, ZstdError, struct.error, ValueError, RuntimeError)


class Record(NamedTuple):
    """One recorded payload.

    Attributes:
        key: The key it was sent on, without the swarm's name.
        payload: The bytes as they were sent.
        seq: The publisher's `seq`, modulo 2^32; 0 if the payload is no valid message.
        publish_ns: The publisher's stamp (its clock); `log_ns` if the payload is no valid message.
        log_ns: When it arrived at the recorder (the recorder's clock).
    """

    key: str
    payload: bytes
    seq: int
    publish_ns: int
    log_ns: int


class Trace:
    """A recorded flight; may be read as often as one likes, but by one reader at a time.

    Args:
        files: Its files, oldest first.

    Attributes:
        files: Its files, oldest first.
        scenario: What flew, resolved.
        metadata: Metadata records by name, of the first file.
        truncated: Whether a file has no end: its recorder was killed, or still records.
        damaged: Chunks that could not be read, as far as has been read.
        dropped: Messages that the recorder says it could not keep, as far as has been read.
        rejected: Payloads that are no valid message by (key, reason), as far as has been read by `messages`.

    Raises:
        ConfigError: The first file is no trace.
    """

    def __init__(self, files: tuple[Path, ...]) -> None:
        self.files = files
        self.truncated = not all(map(has_end, files))
        self.damaged = self.dropped = 0
        self.rejected: Counter[tuple[str, str]] = Counter()
        self.metadata = _head(files[0])
        self.scenario = _scenario(self.metadata, files[0])

    def records(self) -> Iterator[Record]:
        """Yields every payload in the order in which they were recorded, as far as readable."""
        self.damaged = self.dropped = 0
        for file in self.files:
            yield from self._records_in(file)

    def messages(self) -> Iterator[tuple[Record, Message]]:
        """Yields every valid message and its record; counts the others in `rejected`."""
        self.rejected.clear()
        for record in self.records():
            try:
                yield record, decode_on(record.key, record.payload)
            except DecodeError as error:
                self.rejected[record.key, error.reason] += 1

    @property
    def faults(self) -> list[str]:
        """Returns in words what is missing, as far as has been read; empty if nothing is."""
        told = {
            "it has no end: its recorder was killed or still runs": self.truncated,
            f"{self.damaged} damaged chunks were skipped": self.damaged,
            f"its recorder could not keep up and dropped {self.dropped} messages": self.dropped,
        }
        return [text for text, is_so in told.items() if is_so]

    def _records_in(self, file: Path) -> Iterator[Record]:
        topics: dict[int, str] = {}
        dropped = 0
        for item in _top_level(file):
            if isinstance(item, Chunk):
                yield from self._records_of(item, topics)
            elif isinstance(item, Metadata) and item.name == RECORDER:
                dropped = _count(item.metadata.get("dropped", ""))
        self.dropped += dropped

    def _records_of(self, chunk: Chunk, topics: dict[int, str]) -> Iterator[Record]:
        """Takes a chunk apart bit by bit: a replay has no time for a whole one."""
        try:
            data, length = get_chunk_data_stream(chunk, validate_crc=True)
            while data.count < length:
                opcode, size = data.read1(), data.read8()
                if opcode == Opcode.CHANNEL:
                    channel = Channel.read(data)
                    topics[channel.id] = channel.topic
                elif opcode == Opcode.MESSAGE:
                    message = McapMessage.read(data, size)
                    yield _record(topics[message.channel_id], message)
                else:
                    data.read(size)
        except (*_DAMAGE, KeyError):
            self.damaged += 1


def open_trace(source: str | Path | None = None) -> Trace:
    """Opens a recorded flight.

    Args:
        source: A run directory or an MCAP file; None for the newest flight in `runs`.

    Raises:
        ConfigError: There is no trace, or the file is none.
    """
    path = Path(source) if source is not None else RUNS / LATEST
    files = (path,) if path.is_file() else trace_files(path)
    if not files:
        raise ConfigError(
            f"{path}: no trace; record one with swarmtouch up --record or swarmtouch trace record"
        )
    try:
        return Trace(files)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error


def _top_level(file: Path) -> Iterator[object]:
    """Yields what a file holds outside its chunks, and the chunks; ends where it cannot be read on."""
    with file.open("rb") as stream:
        reader = StreamReader(stream, emit_chunks=True, record_size_limit=_LARGEST_RECORD)
        try:
            yield from reader.records
        except _DAMAGE:
            return


def _head(file: Path) -> dict[str, dict[str, str]]:
    metadata = {}
    for item in _top_level(file):
        if isinstance(item, Metadata):
            metadata[item.name] = item.metadata
        elif isinstance(item, Chunk):
            break
    return metadata


def _scenario(metadata: dict[str, dict[str, str]], file: Path) -> Scenario:
    try:
        tree = parse_toml(metadata[SCENARIO]["toml"], str(file))
    except KeyError as error:
        raise ConfigError(f"{file}: not a trace of a swarm: it holds no scenario") from error
    for table, key in _RETIRED:
        if isinstance(tree.get(table), dict):
            tree[table].pop(key, None)
    return structure_scenario(tree, str(file))


def _count(text: str) -> int:
    return int(text) if text.isdecimal() and len(text) < _LONGEST_COUNT else 0


def _record(key: str, message: McapMessage) -> Record:
    return Record(key, message.data, message.sequence, message.publish_time, message.log_time)
