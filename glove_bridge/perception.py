"""Loads the fitted parameters of the model of perception."""

import tomllib
from pathlib import Path

from glove_bridge.distinctiveness import Perception
from shared.config import structure

PARAMETERS = Path(__file__).resolve().parent / "perception.toml"


def load_perception() -> Perception:
    """Reads the parameters that ship."""
    return structure(tomllib.loads(PARAMETERS.read_text(encoding="utf-8")), Perception, str(PARAMETERS))
