"""TOML in: whatever is wrong with a file is told with its name."""

import tomllib
from pathlib import Path
from typing import Any

from shared.errors import ConfigError
from shared.files import read_text


def read_toml(path: Path, hint: str = "") -> dict[str, Any]:
    """Reads a TOML file.

    Args:
        path: The file.
        hint: What to do if there is none.

    Raises:
        ConfigError: It cannot be read or is not TOML.
    """
    try:
        text = read_text(path)
    except ValueError as error:
        raise ConfigError(f"{path}: not valid TOML: {error}") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}{hint and f'; {hint}'}") from error
    return parse_toml(text, str(path))


def parse_toml(text: str, origin: str) -> dict[str, Any]:
    """Parses TOML.

    Args:
        text: The TOML.
        origin: Where it is from, for messages.

    Raises:
        ConfigError: It is not TOML, is nested too deeply, or has numbers of thousands of digits.
    """
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{origin}: not valid TOML: {error}") from error
