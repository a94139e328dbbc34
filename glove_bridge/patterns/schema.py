"""What a file of tactile patterns may say; checked when it is loaded.

Fingers 1 (thumb) to 5 (little), right hand seen from its back: 1 is left. A frame without fingers is a pause.
"""

from typing import Any, Literal

from attrs import Attribute, Factory, field, frozen

from glove_bridge.rules import RULES
from glove_bridge.rules.thresholds import Thresholds

FINGERS = (1, 2, 3, 4, 5)
LOWEST_HZ, HIGHEST_HZ = 50.0, 300.0
"""Where vibration motors run and fingertips feel them."""
SHORTEST_MS, LONGEST_MS = 20, 2000
MOST_FRAMES = 16
LONGEST_PATTERN_MS = 5000

STATE_PATTERNS = ("EI", "ED", "RI", "RD", "CI", "CD", "R", "L")
"""Extended, regular or contracted, with distances increasing or decreasing; displaced right or left."""
ADVICE_PATTERNS = ("CR", "CL", "ER", "EL")
"""The recommended hand motion: contracted or extended, to the right or the left."""
CUE_PATTERNS = ("DRONE_LOST", "HAND_STALE", "FENCE", "BLOCKED", "LOW_BATTERY")
"""Safety cues, the most urgent first."""

VOCABULARIES: dict[str, tuple[str, ...]] = {
    "state": STATE_PATTERNS,
    "advice": ADVICE_PATTERNS,
    "cues": CUE_PATTERNS,
}
"""Meaning of a set -> the patterns that it must have, no more and no fewer."""


def _in(low: float, high: float) -> Any:
    def check(_: Any, attribute: "Attribute[Any]", value: float) -> None:
        if not low <= value <= high:
            raise ValueError(f"{attribute.name} must be {low:g} to {high:g}, not {value!r}")

    return check


def _check_fingers(_: Any, __: "Attribute[Any]", value: dict[str, float]) -> None:
    for finger, hz in value.items():
        if finger not in map(str, FINGERS):
            raise ValueError(f"finger {finger!r} must be 1 (thumb) to 5 (little)")
        if not LOWEST_HZ <= hz <= HIGHEST_HZ:
            raise ValueError(f"finger {finger}: {hz:g} Hz must be {LOWEST_HZ:g} to {HIGHEST_HZ:g}")


@frozen(kw_only=True)
class FrameRow:
    """One frame in a file: `{ ms = 200, hz = { 2 = 200, 4 = 200 } }`."""

    ms: int = field(validator=_in(SHORTEST_MS, LONGEST_MS))
    hz: dict[str, float] = field(factory=dict, validator=_check_fingers)


@frozen(kw_only=True)
class PatternRow:
    """One pattern in a file: its frames, or the name of the pattern that it is backwards.

    Attributes:
        frames: Frames in order.
        reverse_of: Name of a pattern in the same file.
        gate_ms: Time from its start until the next may start; absent: its length and the set's `gap_ms`.
    """

    frames: tuple[FrameRow, ...] = ()
    reverse_of: str | None = None
    gate_ms: int | None = None

    def __attrs_post_init__(self) -> None:
        if bool(self.frames) == (self.reverse_of is not None):
            raise ValueError("a pattern has either frames or reverse_of")
        if len(self.frames) > MOST_FRAMES:
            raise ValueError(f"{len(self.frames)} frames; at most {MOST_FRAMES}")


@frozen(kw_only=True)
class PatternFile:
    """A whole file.

    Attributes:
        about: One line for people.
        meaning: Which patterns there are: `state`, `advice` or `cues`.
        rule: Rule that reads the formation for this set.
        gap_ms: Shortest rest between two patterns.
        silent_gate: Whether a state that has a pattern only with a side, but has no side, closes the gate too.
        thresholds: Parameters of the rule.
        patterns: Name -> pattern.
    """

    about: str
    meaning: Literal["state", "advice", "cues"]
    rule: str = "paper"
    gap_ms: int = field(default=500, validator=_in(0, 5000))
    silent_gate: bool = False
    thresholds: Thresholds = Factory(Thresholds)
    patterns: dict[str, PatternRow] = Factory(dict)

    def __attrs_post_init__(self) -> None:
        if self.rule not in RULES:
            raise ValueError(f"unknown rule {self.rule!r}; rules: {', '.join(RULES)}")
        wanted, named = set(VOCABULARIES[self.meaning]), set(self.patterns)
        if wanted != named:
            missing, extra = sorted(wanted - named), sorted(named - wanted)
            raise ValueError(
                f"meaning {self.meaning!r} has the patterns {', '.join(VOCABULARIES[self.meaning])};"
                f" missing: {', '.join(missing) or 'none'}; unknown: {', '.join(extra) or 'none'}"
            )
