"""Leaves the glove's patterns beside the scenario for the console, which must not know the glove bridge."""

import json
from pathlib import Path

from deploy.launcher.run_directory import write_run_file
from glove_bridge.patterns import CUES, load_patterns
from glove_bridge.patterns.pattern import Pattern
from observer.console.pattern_file import PATTERN_FILE


def write_pattern_file(run_dir: Path, patterns: str) -> Path:
    """Writes `patterns.json` (format: `observer.console.pattern_file`).

    Args:
        run_dir: Directory of the run.
        patterns: Name or file of the pattern set that the bridge uses.

    Returns:
        The file.

    Raises:
        ConfigError: The pattern set is refused, or the file cannot be written.
    """
    cues = load_patterns(CUES).patterns
    everything = {**cues, **load_patterns(patterns).patterns}
    tree = {"frames": {name: _frames(pattern) for name, pattern in everything.items()}, "cues": list(cues)}
    path = run_dir / PATTERN_FILE
    write_run_file(path, json.dumps(tree))
    return path


def _frames(pattern: Pattern) -> list[dict[str, object]]:
    return [
        {"ms": frame.ms, "hz": {str(finger): hz for finger, hz in frame.hz.items()}} for frame in pattern.frames
    ]
