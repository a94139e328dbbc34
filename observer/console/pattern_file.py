"""What the glove's patterns look like, from a JSON file that the launcher leaves beside the scenario.

Patterns belong to the glove bridge; pattern events only name them.
"""

import json
from pathlib import Path
from typing import NamedTuple

from observer.console.swarm_view import Frames
from shared.errors import ConfigError
from shared.files import read_text

PATTERN_FILE = "patterns.json"


class Patterns(NamedTuple):
    """Known patterns.

    Attributes:
        frames: Pattern name -> frames `{ms, hz: {finger: Hz}}`.
        cues: Names of the safety cues among them.
    """

    frames: Frames
    cues: frozenset[str]


NO_PATTERNS = Patterns({}, frozenset())


def read_patterns(path: Path) -> Patterns:
    """Reads the file.

    Raises:
        ConfigError: It is missing or is no pattern file.
    """
    try:
        tree = json.loads(read_text(path))
        frames = {
            str(name): [
                {"ms": int(f["ms"]), "hz": {str(k): float(hz) for k, hz in f["hz"].items()}} for f in rows
            ]
            for name, rows in tree["frames"].items()
        }
        return Patterns(frames, frozenset(map(str, tree["cues"])))
    except Exception as error:
        raise ConfigError(
            f"{path}: no readable pattern file ({type(error).__name__}: {error});"
            " swarmtouch up --console writes one"
        ) from error
