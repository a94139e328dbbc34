"""`record://FILE`: writes what a glove would do, one JSON object per line, flushed at once.

`{"t_ns": ..., "pattern": "EI", "frame": 0, "hz": [0, 0, 150, 0, 0], "ms": 200}` for every frame, and with frame
null and every finger at 0 when a pattern ends or is cut short.
"""

import io
import json
import logging

from glove_bridge.gloves.base import CLOSED
from glove_bridge.gloves.timed import TimedGlove
from glove_bridge.patterns.pattern import Frame, Pattern
from glove_bridge.patterns.schema import FINGERS
from shared.errors import ConfigError
from shared.uri import Uri

_log = logging.getLogger("glove")


class RecordGlove(TimedGlove):
    """Appends to a file.

    Args:
        uri: Its path is the file.

    Raises:
        ConfigError: No path, an option, or the file cannot be written.
    """

    def __init__(self, uri: Uri) -> None:
        super().__init__()
        self._file: io.FileIO | None = _open(uri)

    @staticmethod
    def check(uri: Uri) -> None:
        """See `GloveBackend.check`; the file is there afterwards."""
        _open(uri).close()

    def close(self) -> None:
        """See `Glove.close`."""
        self._end(CLOSED)

    def _show(self, pattern: Pattern | None, frame: Frame | None, now_ns: int) -> None:
        if self._file is None:
            return
        hz = frame.hz if frame else {}
        line = {
            "t_ns": now_ns,
            "pattern": pattern.name if pattern else None,
            "frame": self._frame if frame else None,
            "hz": [hz.get(finger, 0.0) for finger in FINGERS],
            "ms": frame.ms if frame else 0,
        }
        try:
            self._file.write(f"{json.dumps(line)}\n".encode())
        except OSError as error:
            _log.warning("cannot write %s any more: %s; no patterns are recorded", self._file.name, error)
            self._end(f"cannot write {self._file.name}: {error}")

    def _end(self, fault: str) -> None:
        if self._file is not None:
            self._file.close()
            self._file, self.fault = None, fault


def _open(uri: Uri) -> io.FileIO:
    uri.refuse_unknown()
    path = uri.path
    if not path or "\0" in path:
        raise ConfigError(f"{uri.text}: no file; for example record://patterns.jsonl")
    try:
        # Unbuffered: every frame is in the file when it starts, and closing cannot fail.
        return io.FileIO(path, "ab")
    except OSError as error:
        raise ConfigError(f"record://{path}: cannot be written: {error}; choose another file") from error
