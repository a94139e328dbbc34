"""Reads traces, whole or damaged: what is there is yielded, and what is not is said.

A trace is one MCAP file, or a run directory with several: a recorder that was killed and started again begins
a new one. A file may have been through other tools: with or without chunks, packed in any way, with its
metadata at the end. One that ends early (its recorder was killed) is read to its last complete record; a
damaged chunk is skipped, and so are bytes that are no records.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from observer.swarm import LATEST, RUNS, SCENARIO_FILE
from observer.trace import mcap_file
from observer.trace.layout import SCENARIO, trace_files
from observer.trace.mcap_file import ENCODING, DamageError, McapFile, MessageRecord
from observer.trace.order import Record, TimeOrder
from observer.trace.survey import Survey, described, look_through
from shared.codec import decode, decode_on
from shared.config import structure_scenario
from shared.errors import ConfigError, DecodeError
from shared.messages import Message
from shared.plain_text import plain
from shared.scenario import Scenario
from shared.toml_text import parse_toml, read_toml
from shared.topics import TOPICS

MOST_IN_MEMORY = 4_000_000
"""Messages that whoever needs all of them at once takes: a quarter of an hour of 64 drones."""

_RETIRED = (("net", "pointer_port"),)
"""Keys of the scenario that earlier recorders wrote, and that mean nothing any more."""


class Trace:
    """A recorded flight; may be read as often as one likes, but by one reader at a time.

    Args:
        files: Its files, oldest first.

    Attributes:
        files: Its files, oldest first.
        scenario: What flew, resolved.
        metadata: Metadata records by name, of the first file that has a scenario.
        truncated: Whether a file has no end: its recorder was killed, or still records.
        damaged: Records that could not be read, as far as has been read.
        lost: Bytes that are no records, as far as has been read.
        missing: Messages that are to be there and are not, as far as has been read.
        dropped: Messages that the recorder says it could not keep, as far as has been read.
        foreign: Messages in other encodings than ours, by encoding, as far as has been read.
        rejected: Payloads that are no valid message by (key, reason), as far as has been read by `messages`.

    Raises:
        ConfigError: No file is a trace.
        OSError: One cannot be read.
    """

    def __init__(self, files: tuple[Path, ...]) -> None:
        self.files = files
        self._surveys = [look_through(file) for file in files]
        self.truncated = not all(survey.has_end for survey in self._surveys)
        self.rejected: Counter[tuple[str, str]] = Counter()
        self._begin()
        self.metadata, self.scenario, self._scenario_fault = _scenario(files, self._surveys)

    def records(self) -> Iterator[Record]:
        """Yields every payload, file by file and there by the time of its arrival, as far as readable."""
        self._begin()
        for file, survey in zip(self.files, self._surveys, strict=True):
            before = self._read
            yield from self._order.sort(self._records_in(file, survey))
            self.dropped += survey.dropped
            self.missing += max(0, (survey.messages or 0) - (self._read - before))

    def messages(self) -> Iterator[tuple[Record, Message]]:
        """Yields every valid message and its record; counts the others in `rejected`."""
        self.rejected.clear()
        for record in self.records():
            try:
                yield record, decode_on(record.key, record.payload)
            except DecodeError as error:
                self.rejected[record.key, error.reason] += 1

    def all_messages(self) -> Iterator[tuple[Record, Message]]:
        """Yields the same, to who keeps them.

        Raises:
            ConfigError: They are more than can be kept.
        """
        for count, item in enumerate(self.messages()):
            if count >= MOST_IN_MEMORY:
                raise ConfigError(
                    f"{self.files[0]}: more than {MOST_IN_MEMORY} messages; take a part of it: mcap filter"
                )
            yield item

    @property
    def faults(self) -> list[str]:
        """Returns in words what is missing, as far as has been read; empty if nothing is."""
        told: dict[str, object] = {
            "it has no end: its recorder was killed or still runs": self.truncated,
            self._scenario_fault: self._scenario_fault,
            f"{self.damaged} damaged chunk{'s were' if self.damaged > 1 else ' was'} skipped": self.damaged,
            f"{self.lost} damaged bytes were skipped": self.lost,
            f"{self.missing} messages that it counts are not in it": self.missing,
            f"its recorder could not keep up and dropped {self.dropped} messages": self.dropped,
            f"{self._order.late} messages are far out of order": self._order.late,
            f"{self._nameless} messages are on channels whose definition is damaged": self._nameless,
        }
        return [
            *(text for text, is_so in told.items() if is_so),
            *(f"{count} messages are {plain(name)}, not {ENCODING}" for name, count in self.foreign.items()),
        ]

    def _begin(self) -> None:
        self.damaged = self.lost = self.missing = self.dropped = self._nameless = self._read = 0
        self.foreign: Counter[str] = Counter()
        self._order = TimeOrder()

    def _records_in(self, path: Path, survey: Survey) -> Iterator[Record]:
        channels = dict(survey.channels)
        with mcap_file.open_mcap(path) as stream:
            file = McapFile(stream)
            for opcode, content in self._outside_chunks(file):
                if opcode == mcap_file.CHUNK:
                    yield from self._understood(self._in_chunk(content), channels)
                else:
                    yield from self._understood([(opcode, content)], channels)
            self.lost += file.lost

    def _outside_chunks(self, file: McapFile) -> Iterator[tuple[int, bytes]]:
        for located in file.records():
            if located.opcode in (mcap_file.CHUNK, mcap_file.CHANNEL, mcap_file.MESSAGE):
                try:
                    yield located.opcode, file.content(located)
                except DamageError:
                    self.damaged += 1

    def _in_chunk(self, content: bytes) -> Iterator[tuple[int, bytes]]:
        try:
            yield from mcap_file.open_chunk(content)
        except DamageError:
            self.damaged += 1

    def _understood(
        self, records: Iterable[tuple[int, bytes]], channels: dict[int, tuple[str, str]]
    ) -> Iterator[Record]:
        """Yields the messages among records; learns the channels among them."""
        for opcode, content in records:
            try:
                if opcode == mcap_file.CHANNEL:
                    channel = mcap_file.read_channel(content)
                    channels[channel.id] = (channel.topic, channel.encoding)
                elif opcode == mcap_file.MESSAGE:
                    message = mcap_file.read_message(content)
                    self._read += 1
                    yield from self._known(message, channels)
            except DamageError:
                self.damaged += 1

    def _known(self, message: MessageRecord, channels: dict[int, tuple[str, str]]) -> Iterator[Record]:
        topic, encoding = channels.get(message.channel_id, (None, ENCODING))
        if encoding not in (ENCODING, ""):
            self.foreign[encoding] += 1
        elif (key := _key_of(message.data) if topic is None else topic) is None:
            self._nameless += 1
        else:
            yield Record(key, message.data, message.sequence, message.publish_ns, message.log_ns)


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


def _scenario(
    files: tuple[Path, ...], surveys: list[Survey]
) -> tuple[dict[str, dict[str, str]], Scenario, str]:
    """Returns the metadata of a trace, what flew, and what is wrong with that in the trace itself, in words.

    Raises:
        ConfigError: Nobody knows what flew.
    """
    why = f"it holds no scenario{described(surveys)}"
    for file, survey in zip(files, surveys, strict=True):
        if SCENARIO not in survey.metadata:
            continue
        try:
            toml = survey.metadata[SCENARIO].get("toml", "")
            return survey.metadata, _structured(parse_toml(toml, str(file)), file), ""
        except ConfigError as error:
            why = f"its scenario is damaged: {error}"
    beside = files[0].parent / SCENARIO_FILE
    if beside.is_file():
        fault = f"{why}; that of {SCENARIO_FILE} beside it is taken"
        return surveys[0].metadata, _structured(read_toml(beside), beside), fault
    if not any(map(mcap_file.begins_as_mcap, files)):
        why = "it is no MCAP file" if files[0].stat().st_size else "it is empty"
    raise ConfigError(f"{files[0]}: not a trace of a swarm: {why}")


def _structured(tree: dict[str, Any], file: Path) -> Scenario:
    for table, key in _RETIRED:
        if isinstance(tree.get(table), dict):
            tree[table].pop(key, None)
    return structure_scenario(tree, str(file))


def _key_of(payload: bytes) -> str | None:
    """Tells by a message what it was sent on."""
    for topic in TOPICS:
        try:
            message = decode(payload, topic.kind)
        except DecodeError:
            continue
        return topic.pattern.format(**{name: getattr(message, name) for name in message.__struct_fields__})
    return None
