"""`swarmtouch glove play`: plays a pattern, or a whole set, on a glove."""

import argparse
import time

from deploy.glove.device import worn
from deploy.glove.player import play, tell
from glove_bridge.patterns import load_patterns
from shared.clock import system_clock
from shared.errors import ConfigError

ALL = "all"


def run(arguments: argparse.Namespace) -> int:
    """Plays it and returns whether everything was felt.

    Raises:
        ConfigError: No such set or pattern, or a URI that is refused.
        DeviceError: The glove does not answer.
    """
    patterns = load_patterns(arguments.patterns)
    if arguments.name not in (ALL, *patterns.patterns):
        known = ", ".join(patterns.patterns)
        raise ConfigError(
            f"{arguments.name}: no such pattern in set {patterns.name!r}; it has {known}; or {ALL}"
        )
    chosen = [p for name, p in patterns.patterns.items() if arguments.name in (ALL, name)]
    clock, code = system_clock(), 0
    with worn(arguments.glove) as glove:
        for k, pattern in enumerate(chosen):
            if k:
                time.sleep((pattern.gate_ms - pattern.length_ms) / 1000.0)
            code |= tell(pattern, play(glove, pattern, clock))
    return code
