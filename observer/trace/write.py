"""Writes traces that survive: whatever happens to the recorder, all but the last moment is on disk."""

import json
import os
import platform
from collections import Counter
from importlib.metadata import version
from itertools import count
from pathlib import Path
from typing import IO

from mcap.writer import Writer

from observer.trace.layout import RECORDER, SCENARIO, trace_file
from observer.trace.schemas import json_schema
from shared.codec import decode_on
from shared.config import dump_scenario
from shared.errors import ConfigError, DecodeError
from shared.messages import SCHEMA_VERSION
from shared.scenario import Scenario
from shared.topics import topic_of
from shared.transport import Arrival

MOST_KEYS = 4096
"""Keys in one trace; what a foreign session makes up beyond is refused (MCAP itself ends at 65535)."""

_SEQUENCES = 1 << 32
_NO_SCHEMA = 0
"""Of what came on a key of no topic nothing is known, as MCAP says it."""


class TraceWriter:
    """One new trace in a run directory.

    Payloads are kept byte by byte (message encoding `msgpack`), with a JSON Schema per channel; `publish_time`
    and `sequence` are the publisher's, `log_time` is the recorder's.

    Args:
        folder: The run directory; created if missing. Earlier traces in it are never touched.
        scenario: What flies, resolved.

    Attributes:
        path: The file.
        written: Messages so far.
        rejected: Payloads that are no valid message, by reason; they are written all the same.
        refused: Messages on more keys than a trace holds; they are not.

    Raises:
        ConfigError: It cannot be written there.
    """

    def __init__(self, folder: Path, scenario: Scenario) -> None:
        self.path, self._file = _create(folder)
        self.written = self.refused = 0
        self.rejected: Counter[str] = Counter()
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._dropped = 0
        self._writer = Writer(self._file)
        self._writer.start(profile="swarmtouch", library=f"swarmtouch {version('swarmtouch')}")
        self._writer.add_metadata(SCENARIO, {"name": scenario.swarm.name, "toml": dump_scenario(scenario)})
        self._writer.add_metadata("versions", _versions())
        self._writer.add_metadata("host", _host())
        self._writer.flush()

    def add(self, key: str, arrival: Arrival) -> None:
        """Writes one payload, whatever it is, and on whatever key."""
        channel = self._channels.get(key) or self._register(key)
        if channel is None:
            self.refused += 1
            return
        payload, log_ns = arrival
        seq, stamp_ns = 0, log_ns
        try:
            message = decode_on(key, payload)
            seq, stamp_ns = message.seq, message.stamp_ns
        except DecodeError as error:
            self.rejected[error.reason] += 1
        self._writer.add_message(channel, log_ns, payload, publish_time=stamp_ns, sequence=seq % _SEQUENCES)
        self.written += 1

    def flush(self, dropped: int) -> None:
        """Hands everything so far to the operating system: a recorder that is killed now loses none of it.

        Args:
            dropped: How many messages did not get here so far.
        """
        if dropped + self.refused != self._dropped:
            self._dropped = dropped + self.refused
            self._writer.add_metadata(RECORDER, {"dropped": str(self._dropped)})
        self._writer.flush()

    def close(self, dropped: int) -> None:
        """Finishes the file; `dropped` as for `flush`."""
        self.flush(dropped)
        self._writer.finish()
        self._file.close()

    def _register(self, key: str) -> int | None:
        if len(self._channels) >= MOST_KEYS:
            return None
        channel = self._writer.register_channel(key, "msgpack", self._schema(key))
        self._channels[key] = channel
        return channel

    def _schema(self, key: str) -> int:
        try:
            kind = topic_of(key).kind
        except DecodeError:
            return _NO_SCHEMA
        name = f"swarmtouch.{kind.__name__}"
        if name not in self._schemas:
            schema = json.dumps(json_schema(kind)).encode()
            self._schemas[name] = self._writer.register_schema(name, "jsonschema", schema)
        return self._schemas[name]


def _create(folder: Path) -> tuple[Path, IO[bytes]]:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for number in count(1):
            path = trace_file(folder, number)
            try:
                return path, path.open("xb")
            except FileExistsError:
                continue
    except OSError as error:
        raise ConfigError(f"{folder}: no trace can be written there: {error}; name another with -o") from error
    raise AssertionError("count never ends")


def _versions() -> dict[str, str]:
    packages = ("swarmtouch", "eclipse-zenoh", "mcap")
    return {
        "python": platform.python_version(),
        "messages": str(SCHEMA_VERSION),
        **{package: version(package) for package in packages},
    }


def _host() -> dict[str, str]:
    return {"name": platform.node(), "system": platform.platform(), "cores": str(os.cpu_count())}
