"""Tactile patterns: data files, their schema, and what is loaded from them."""

import contextlib
import difflib
from pathlib import Path

from glove_bridge.patterns.pattern import Frame, Pattern, PatternSet
from glove_bridge.patterns.schema import LONGEST_PATTERN_MS, PatternFile, PatternRow
from shared.config import structure
from shared.errors import ConfigError
from shared.toml_text import read_toml

FOLDER = Path(__file__).resolve().parent
CUES = "cues"
"""The set of the safety cues; it plays beside any other."""


def shipped_sets() -> list[str]:
    """Returns the names of the pattern sets that ship."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_patterns(source: str | Path) -> PatternSet:
    """Reads one pattern set.

    Args:
        source: Path of a TOML file, or the name of a set that ships.

    Raises:
        ConfigError: What is wrong, with file, key and a hint.
    """
    path = _find(source)
    file = structure(read_toml(path), PatternFile, str(path))
    return PatternSet(
        name=path.stem,
        about=file.about,
        meaning=file.meaning,
        rule=file.rule,
        silent_gate=file.silent_gate,
        thresholds=file.thresholds,
        patterns={name: _build(file, name, path) for name in file.patterns},
    )


def _find(source: str | Path) -> Path:
    for path in (Path(source), FOLDER / f"{source}.toml"):
        with contextlib.suppress(OSError):  # a name that is too long for any file
            if path.is_file():
                return path
    close = difflib.get_close_matches(str(source), shipped_sets(), 1)
    hint = f"did you mean {close[0]!r}?" if close else f"sets that ship: {', '.join(shipped_sets())}"
    raise ConfigError(f"{source}: no such pattern set; {hint}")


def _build(file: PatternFile, name: str, path: Path) -> Pattern:
    row = file.patterns[name]
    where = f"{path}: at key patterns.{name}"
    frames = _frames(row) if row.reverse_of is None else _reversed(file, row.reverse_of, where)
    length_ms = sum(frame.ms for frame in frames)
    if not any(frame.hz for frame in frames):
        raise ConfigError(f"{where}: no finger vibrates in it; give a frame hz, for example {{ 3 = 250 }}")
    if length_ms > LONGEST_PATTERN_MS:
        raise ConfigError(f"{where}: {length_ms} ms long; at most {LONGEST_PATTERN_MS}")
    gate_ms = length_ms + file.gap_ms if row.gate_ms is None else row.gate_ms
    if gate_ms < length_ms:
        raise ConfigError(f"{where}: gate_ms {gate_ms} is shorter than the pattern, {length_ms} ms")
    return Pattern(name=name, frames=frames, gate_ms=gate_ms)


def _frames(row: PatternRow) -> tuple[Frame, ...]:
    return tuple(Frame(ms=frame.ms, hz={int(f): hz for f, hz in frame.hz.items()}) for frame in row.frames)


def _reversed(file: PatternFile, other: str, where: str) -> tuple[Frame, ...]:
    row = file.patterns.get(other)
    if row is None or not row.frames:
        raise ConfigError(f"{where}: reverse_of {other!r} must name a pattern of this file that has frames")
    return _frames(row)[::-1]
