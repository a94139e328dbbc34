"""What an MCAP file says about itself outside its messages, wherever in it that stands."""

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from observer.trace import mcap_file
from observer.trace.layout import RECORDER
from observer.trace.mcap_file import DamageError, McapFile
from shared.plain_text import plain

_MOST_METADATA = 20
_MOST_NAMED = 10
_LONGEST_COUNT = 20


class Survey(NamedTuple):
    """What a file says about itself.

    Attributes:
        metadata: Records by name.
        channels: Number -> topic and encoding, as far as they stand outside chunks.
        messages: How many there are to be; None if it does not say.
        dropped: How many messages its recorder says it could not keep.
        has_end: Whether it was finished.
    """

    metadata: dict[str, dict[str, str]]
    channels: dict[int, tuple[str, str]]
    messages: int | None
    dropped: int
    has_end: bool


def look_through(path: Path) -> Survey:
    """Looks through a file, but for its messages; raises `OSError`."""
    metadata: dict[str, dict[str, str]] = {}
    channels: dict[int, tuple[str, str]] = {}
    messages, dropped = None, 0
    with mcap_file.open_mcap(path) as stream:
        file = McapFile(stream)
        for record in file.records():
            try:
                match record.opcode:
                    case mcap_file.METADATA:
                        name, entries = mcap_file.read_metadata(file.content(record))
                        if name == RECORDER:
                            dropped = _count(entries.get("dropped", ""))
                        elif len(metadata) < _MOST_METADATA:
                            metadata.setdefault(name, entries)
                    case mcap_file.CHANNEL:
                        channel = mcap_file.read_channel(file.content(record))
                        channels[channel.id] = (channel.topic, channel.encoding)
                    case mcap_file.STATISTICS:
                        messages = mcap_file.read_message_count(file.content(record))
            except DamageError:
                continue
        return Survey(metadata, channels, messages, dropped, file.has_end)


def described(surveys: Iterable[Survey]) -> str:
    """Names what is in files, as far as it stands outside chunks."""
    found = sorted({channel for survey in surveys for channel in survey.channels.values()})
    named = [f"{plain(topic)} ({plain(encoding)})" for topic, encoding in found[:_MOST_NAMED]]
    return f", but {', '.join(named)}" if named else ""


def _count(text: str) -> int:
    return int(text) if text.isdecimal() and len(text) < _LONGEST_COUNT else 0
