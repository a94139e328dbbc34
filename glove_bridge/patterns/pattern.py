"""A tactile pattern and a set of them, as loaded."""

from collections.abc import Mapping
from typing import Literal

from attrs import field, frozen

from glove_bridge.rules.thresholds import Thresholds


@frozen
class Frame:
    """Which fingers vibrate for how long.

    Attributes:
        ms: Length, ms.
        hz: Finger 1 (thumb) .. 5 (little) -> frequency, Hz; the others rest.
    """

    ms: int
    hz: Mapping[int, float] = field(hash=False)


@frozen(kw_only=True)
class Pattern:
    """Frames, one after the other, without gaps.

    Attributes:
        name: What it means, see `glove_bridge.patterns.schema`.
        frames: At least one.
        gate_ms: Time from its start until the next pattern may start, ms.
    """

    name: str
    frames: tuple[Frame, ...]
    gate_ms: int

    @property
    def length_ms(self) -> int:
        """Length of the whole pattern, ms."""
        return sum(frame.ms for frame in self.frames)


@frozen(kw_only=True)
class PatternSet:
    """One file of patterns.

    Attributes:
        name: Name of the set.
        about: One line for people.
        meaning: Which vocabulary its patterns are.
        rule: Rule that reads the formation for it.
        silent_gate: Whether a state that has a pattern only with a side, but has no side, closes the gate too.
        thresholds: Parameters of the rule.
        patterns: Name -> pattern.
    """

    name: str
    about: str
    meaning: Literal["state", "advice", "cues"]
    rule: str
    silent_gate: bool
    thresholds: Thresholds
    patterns: Mapping[str, Pattern] = field(hash=False)
