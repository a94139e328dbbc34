"""Reads and writes calibrations: TOML, refused with file, key and a hint when they are wrong."""

from pathlib import Path

import tomli_w
from attrs import asdict

from glove_bridge.calibration import Calibration
from shared.config import structure
from shared.errors import ConfigError
from shared.toml_text import read_toml

SHIPPED = Path(__file__).resolve().parent / "coin-motors.toml"
"""Typical values, so that a glove vibrates before it is calibrated."""


def load_calibration(source: str | Path | None = None) -> Calibration:
    """Reads a calibration.

    Args:
        source: Its file; the shipped one by default.

    Raises:
        ConfigError: What is wrong, with file, key and a hint.
    """
    path = Path(source) if source else SHIPPED
    tree = read_toml(path, "make a calibration: swarmtouch glove calibrate")
    return structure(tree, Calibration, str(path))


def save_calibration(calibration: Calibration, path: Path) -> None:
    """Writes a calibration that `load_calibration` reads back to an equal one.

    Raises:
        ConfigError: The file cannot be written.
    """
    try:
        path.write_text(tomli_w.dumps(asdict(calibration)), encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error}") from error
