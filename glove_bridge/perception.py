"""Loads the fitted parameters of the model of perception."""

from pathlib import Path

from glove_bridge.distinctiveness import Perception
from shared.config import structure
from shared.toml_text import read_toml

PARAMETERS = Path(__file__).resolve().parent / "perception.toml"


def load_perception() -> Perception:
    """Reads the parameters that ship."""
    return structure(read_toml(PARAMETERS), Perception, str(PARAMETERS))
