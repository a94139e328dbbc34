"""Rules: how the state of a formation is read; one row per rule."""

from collections.abc import Callable

from glove_bridge.formation_state import Geometry, Memory, Reading, Scene
from glove_bridge.rules import flight_2018, paper
from glove_bridge.rules.thresholds import Thresholds

Rule = Callable[[Geometry, Scene, Memory, Thresholds], tuple[Reading, Memory]]

RULES: dict[str, Rule] = {
    "paper": paper.read,
    "flight-2018": flight_2018.read,
}
"""Name -> rule, as pattern sets choose it."""
